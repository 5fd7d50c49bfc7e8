"""Feasibility of references: limits, refusals in words, retiming."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.mission import (
    Feasibility,
    InfeasibleReference,
    Mission,
    feasibility,
    load_scenario,
)
from uam_control.mission.feasibility import in_words
from uam_control.mission.scenarios.scenario_options import SLOWEST
from uam_control.profiles.profile import ProfileError, load_profile
from uam_control.supervision import Readings
from uam_lab.flights.flight_settings import settings as flight_settings

PROFILE = load_profile("s500")
OPEN = replace(
    PROFILE.sets["mission"], reference_thrust=36.0, reference_tilt=1.2, tilt_hold=1.25,
    tilt_failsafe=1.4, reference_yaw_rate=8.0, reference_yaw_torque=1.0,
)  # fmt: skip
IN_TIME = PROFILE.sets["mission"]


def checked(limits=OPEN, payload=0.0):
    return Feasibility(PROFILE.vehicle, limits, payload)


def demand(check, scenario):
    """Return what the whole flight from the origin needs."""
    flown, trajectory = scenario.from_origin()
    times = np.arange(0.0, flown.landing.end, feasibility.STEP)
    return check.needs.along(trajectory, times, check.carried(flown, times))


def with_full_thrust(full):
    """The S-500 with another full thrust [N]."""
    vehicle = PROFILE.vehicle
    coefficient = full / len(vehicle.rotors) / vehicle.rotor.speed_max**2
    return replace(vehicle, rotor=replace(vehicle.rotor, thrust_coefficient=coefficient))


def scenario_of(folder, text):
    file = folder / "made.yaml"
    file.write_text(text)
    return load_scenario(str(file))


def circle(folder, radius=1.0, speed=2.0, more=""):
    return scenario_of(
        folder,
        f"trajectory: {{kind: circle, radius: {radius}, speed: {speed}, laps: 4, height: 1.5, "
        f"ramp: {1 + speed}{more}}}",
    )


def zigzag(folder, period):
    """Back and forth along x with 45 degrees of tilt, `period` [s] one way."""
    way = 0.79 / 0.7943 * 1.3124 * period**2  # minimum snap: 7.513 way / period^2 = g tan(tilt)
    moves = [f"{{coordinate: x, from: 4, until: 7, to: {-way / 2:.4f}}}"]
    for i in range(6):
        begin, to = 7.5 + i * period, (-way / 2, way / 2)[(i + 1) % 2]
        moves.append(
            f"{{coordinate: x, from: {begin:.3f}, until: {begin + period:.3f}, to: {to:.4f}}}"
        )
    end = 7.5 + 6 * period
    moves.append(f"{{coordinate: x, from: {end + 0.5}, until: {end + 4}, to: 0}}")
    up = "{coordinate: z, from: 0, until: 3, to: 2}"
    rest = f"landing: {{at: {end + 4}, duration: 4}}"
    return scenario_of(folder, f"moves: [{', '.join([up, *moves])}]\n{rest}")


@pytest.mark.parametrize(
    ("period", "delay"),
    # flown with every delay: 1.6 s lost at 30 ms, 2 s at 30 ms, 2.3 s at 40 ms; 2.5 s flown at 40
    [(1.6, -0.01), (2.0, 0.0125), (2.3, 0.028), (2.5, 0.04)],
)
def test_the_faster_a_zigzag_the_less_delay_it_stands(tmp_path, period, delay):
    excesses, stands = Feasibility(PROFILE.vehicle, IN_TIME, 0.0).examined(zigzag(tmp_path, period))
    assert stands == pytest.approx(delay, abs=0.004)
    assert ("change of the body rate" in in_words(excesses)) is (delay < 0.0)
    limits = replace(IN_TIME, reference_delay=stands + 0.001)
    with pytest.raises(InfeasibleReference, match="change of the body rate"):
        Feasibility(PROFILE.vehicle, limits, 0.0).check(zigzag(tmp_path, period))


def test_a_delay_that_the_reference_does_not_stand_is_in_the_pre_arm_report(tmp_path):
    mission = Mission(zigzag(tmp_path, 2.0), IN_TIME, vehicle=PROFILE.vehicle)
    state = np.zeros((3, 8))
    state[0, 2], state[0, 6:] = 0.285, mission.scenario.arm_start
    fresh = {"mocap_age": 0.0, "joint_age": 0.0, "controller_age": 0.0, "autopilot_age": 0.0}
    mission.step(0.0, state, None, Readings(**fresh, round_trip=0.004))
    assert mission.start() == (True, "arming")
    mission = Mission(zigzag(tmp_path, 2.0), IN_TIME, vehicle=PROFILE.vehicle)
    mission.step(0.0, state, None, Readings(**fresh, round_trip=0.028))
    accepted, why = mission.start()
    assert not accepted and "delay for the reference: 0.028 s (at most 0.01" in why


@pytest.mark.parametrize("name", ["race_5", "race_5_payload", "race_10", "race_10_payload"])
def test_the_races_stand_every_delay_that_a_flight_is_allowed(name):
    limits = load_profile("s500", "race_10").sets["mission"]
    excesses, stands = Feasibility(PROFILE.vehicle, limits, 0.2).examined(load_scenario(name))
    assert not excesses and stands > limits.setpoint_delay_land


def test_the_refusal_says_what_exceeds_which_limit_and_when():
    with pytest.raises(InfeasibleReference) as caught:
        checked().check(load_scenario("ellipse"))
    assert str(caught.value) == (
        "scenario ellipse: thrust 42.3 N exceeds 36 N at 22.7 s (from 22.3 s on)"
    )


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"tilt_hold": 0.3}, "tilt 0.387 rad exceeds 0.3 rad at"),
        ({"reference_tilt": 0.3}, "tilt 0.387 rad exceeds 0.3 rad at"),
        ({"reference_thrust": 22.0}, "thrust 23.8 N exceeds 22 N at"),
        ({"reference_body_rate": 0.5}, r"body rate 0.8\d* rad/s exceeds 0.5 rad/s at"),
        ({"reference_yaw_torque": 0.01}, r"yaw torque 0.0\d+ N m exceeds 0.01 N m at"),
        ({"reference_turn": 2.0}, r"body rate 2.\d+ rad/s\^2 exceeds 1.54 rad/s\^2 at"),
        (
            {"reference_turn": 4.0, "reference_delay": 0.04},
            r"change of the body rate 2.\d+ rad/s\^2 exceeds 2 rad/s\^2 at",
        ),
        ({"body_rate_hold": 0.5}, r"body rate 0.8\d* rad/s exceeds 0.5 rad/s at"),
        ({"geofence_high": (0.5, 5.0, 6.0)}, "^x 1 m exceeds 0.5 m at"),
        ({"geofence_low": (-5.0, -0.5, -1.0)}, "^y -1 m is below -0.5 m at"),
        ({"altitude_hold": 1.0}, r"z 1.5 m exceeds 1.2\d m at"),
        ({"joint_effort_hold": (0.1, 2.8)}, r"joint 1 torque 0.\d+ N m exceeds 0.1 N m at"),
        ({"joint_angle_hold": (1.9, 1.2)}, r"joint 2 angle 1.57 rad exceeds 1.2 rad at 0.0 s"),
    ],
)
def test_every_limit_counts(tmp_path, change, text):
    scenario = circle(tmp_path)
    assert not checked().excesses(scenario)
    found = checked(replace(OPEN, **change)).excesses(scenario)
    assert re.search(text, in_words(found))


@settings(max_examples=12, deadline=None)
@given(radius=st.floats(0.5, 3.0), speed=st.floats(2.0, 5.0), payload=st.floats(0.0, 0.4))
def test_retimed_is_feasible_and_not_slower_than_necessary(
    tmp_path_factory, radius, speed, payload
):
    text = f"{{kind: circle, radius: {radius}, speed: {speed}, laps: 30, height: 1.5, ramp: 6}}"
    scenario = scenario_of(tmp_path_factory.mktemp("made"), f"trajectory: {text}")
    check = checked(payload=payload)
    retimed, factor = check.retimed(scenario)
    reserved = replace(check, reserve=check.limits.retime_reserve)
    assert not reserved.excesses(retimed) and 1.0 <= factor <= SLOWEST
    if factor > 1.0:
        assert reserved.excesses(scenario)
        assert reserved.excesses(scenario.slowed(factor / 1.02))
    else:
        assert retimed is scenario


def csv_of(folder, row):
    """Rows of a way at speed: row(t) → x, y, z, for 1 s."""
    file = folder / "fast.csv"
    rows = [",".join(f"{v:.6f}" for v in (t, *row(t))) for t in np.arange(0.0, 1.001, 0.01)]
    file.write_text("\n".join(["t,px,py,pz", *rows]) + "\n")
    return load_scenario(str(file))


@pytest.mark.parametrize(
    ("row", "words"),
    [
        # 6 m/s: from rest with 3 m/s^2 it needs more room than the fence leaves
        (lambda t: (-3 + 6 * t, 0, 1.5), "run-up: x -16.* m is below -5 m at .*; run-out: x 16"),
        (
            lambda t: (t, 0, 0.5 + 2.5 * t),
            ".*run-up: height while it moves across -.* m is below 0.05",
        ),
    ],
)
def test_a_refusal_names_the_ramp_that_is_its_reason(tmp_path, row, words):
    assert re.match(words, in_words(checked().excesses(csv_of(tmp_path, row))))


def test_a_place_outside_the_geofence_is_not_retimed(tmp_path):
    with pytest.raises(InfeasibleReference, match="x 6 m exceeds 5 m .* a slowdown does not help"):
        checked().retimed(circle(tmp_path, more=", centre: [5, 0]"))


@pytest.mark.parametrize(
    ("full", "limit"),
    # 36 N of a profile: it leaves at least 3 % of the full thrust, or the limit is 85 % of that
    [(41.4, 36.0), (37.2, 36.0), (37.0, 31.45), (28.05, 23.8425)],
)
def test_the_vehicles_own_full_thrust_limits_a_reference(full, limit):
    check = Feasibility(with_full_thrust(full), OPEN, 0.2)
    assert check.thrust_limit == pytest.approx(limit)


def test_a_reserve_is_a_share_of_the_thrust_beyond_the_weight():
    check = Feasibility(with_full_thrust(41.4), OPEN, 0.2)  # limit: 36 N of the profile
    weight = (check.vehicle.mass + 0.2) * check.vehicle.gravity
    assert replace(check, reserve=0.5).thrust_limit == pytest.approx((36.0 + weight) / 2.0)
    heavy = replace(check, payload_mass=5.0, reserve=0.5)  # no reserve: refused as without
    assert heavy.thrust_limit == pytest.approx(36.0)


def test_a_note_says_that_a_reference_leaves_little_thrust():
    race, circle_ = load_scenario("race_5_payload"), load_scenario("circle")
    check = Feasibility(with_full_thrust(41.4), OPEN, 0.2)
    assert re.match("the reference needs 29.6 of 36 N, .* --retime leaves some", check.check(race))
    assert replace(check, limits=replace(OPEN, retime_reserve=0.0)).check(race) == ""
    assert replace(check, payload_mass=0.0).check(circle_) == ""


def test_what_a_weak_vehicle_cannot_lift_is_refused_and_retimed():
    weak = Feasibility(with_full_thrust(28.06), OPEN, 0.2)
    race = load_scenario("race_5_payload")
    with pytest.raises(InfeasibleReference, match="thrust 29.6 N exceeds 23.9 N, 85 % of the full"):
        weak.check(race)
    with pytest.raises(InfeasibleReference, match=r"thrust .* exceeds 23.9 N.* does not help"):
        replace(weak, payload_mass=0.7).retimed(race)  # the weight alone is 28.4 N
    retimed, factor = replace(weak, payload_mass=0.0).retimed(load_scenario("ellipse"))
    assert 1.5 < factor < SLOWEST


HARD = replace(OPEN, reference_thrust=19.0, reference_tilt=0.1, tilt_hold=0.3)


@pytest.mark.parametrize("name", ["quick_pick", "circle", "circle_payload", "lemniscate"])
@pytest.mark.parametrize("part", [7, 100, 1999])
def test_a_flight_checked_in_parts_exceeds_what_the_whole_exceeds(name, part, monkeypatch):
    scenario, check = load_scenario(name), checked(HARD, payload=0.3)
    whole = check.exceeded(demand(check, scenario))
    assert whole
    monkeypatch.setattr(feasibility, "PART", part)
    for found, expected in zip(check.excesses(scenario), whole, strict=True):
        assert found.text == expected.text
        assert found.value == pytest.approx(expected.value, rel=1e-9)


def test_payload_counts_while_the_magnet_is_on():
    scenario = load_scenario("quick_pick")
    bare, loaded = (demand(checked(payload=mass), scenario) for mass in (0.0, 0.4))
    on = np.array([scenario.magnet_on(t) for t in bare.times])
    np.testing.assert_allclose(bare.thrust[~on], loaded.thrust[~on])
    assert (loaded.thrust[on] > bare.thrust[on] + 0.35 * 9.0).all()
    assert loaded.joint_torques[on].max() > bare.joint_torques[on].max() + 0.1


@pytest.mark.parametrize("name", ["pick_and_place", "quick_pick", "hover", "circle", "arm_motions"])
@pytest.mark.parametrize("law", ["s500", "asmc1", "asmc2", "paper_table1"])
def test_the_missions_of_every_profile_are_feasible(name, law):
    limits = load_profile(law).sets["mission"]
    assert not Feasibility(PROFILE.vehicle, limits, 0.4).excesses(load_scenario(name))


def test_limits_of_the_reference_follow_from_the_position_controller(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("position_controller:\n  ros__parameters: {tilt_max: 0.5, thrust_max: 39.0}\n")
    limits = load_profile("s500", str(file)).sets["mission"]
    assert (limits.reference_tilt, limits.reference_thrust) == (0.5, 39.0)


def test_limits_of_the_body_rates_follow_from_bridge_and_attitude_controller(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "mavlink_bridge:\n  ros__parameters: {rate_limit: [4.0, 5.0, 2.0]}\n"
        "attitude_controller:\n  ros__parameters: {torque_max: [0.66, 1.32, 0.3]}\n"
    )
    limits = load_profile("s500", str(file)).sets["mission"]
    assert limits.reference_body_rate == pytest.approx(3.6)
    assert limits.reference_yaw_rate == pytest.approx(1.8)
    assert limits.reference_turn == pytest.approx(15.0)  # 0.75 * 0.66 / 0.033
    assert limits.reference_yaw_torque == pytest.approx(0.225)  # 0.75 * 0.3


@pytest.mark.parametrize("given", ["[1.0, 2.0]", "3.0", "fast"])
def test_a_rate_limit_that_is_no_list_of_three_is_refused_in_one_line(tmp_path, given):
    file = tmp_path / "mine.yaml"
    file.write_text(f"mavlink_bridge:\n  ros__parameters: {{rate_limit: {given}}}\n")
    with pytest.raises(ProfileError, match="mission: rate_limit: "):
        load_profile("s500", str(file))


def test_a_flight_is_refused_before_it_starts_or_slowed_down():
    with pytest.raises(InfeasibleReference, match="scenario ellipse: .*thrust 42.3 N"):
        flight_settings("ellipse", engine="direct")
    made = flight_settings("ellipse", engine="direct", retime=True)
    factor = made.scenario_options.slowdown
    assert factor > 1.0 and made.notes == (f"retimed: {factor:.4g} times as slow",)
    assert made.scenario.landing.at > load_scenario("ellipse").landing.at


NEAR_GROUND = [
    ("moves: [{coordinate: z, from: 0, until: 2, to: 0.3},"
     " {coordinate: x, from: 2, until: 6, to: 1}]\nlanding: {at: 7, duration: 3}",
     "height while it moves across 0.015 m is below 0.05 m"),
    ("trajectory: {kind: circle, radius: 0.5, speed: 0.5, height: 0.25}",
     "height while it moves across"),
    ("moves: [{coordinate: z, from: 0, until: 3, to: 1}]\nlanding: {at: 4, duration: 1}",
     "sink rate near the ground"),
    ("moves: [{coordinate: z, from: 0, until: 3, to: 1}]\nlanding: {at: 4, duration: 3}", ""),
    ("moves: [{coordinate: z, from: 0, until: 3, to: 0.5},"
     " {coordinate: x, from: 3, until: 6, to: 1}]\nlanding: {at: 7, duration: 3}", ""),
]  # fmt: skip


@pytest.mark.parametrize(("text", "reason"), NEAR_GROUND)
def test_what_turns_over_on_the_ground_or_hits_it_is_refused(tmp_path, text, reason):
    file = tmp_path / "low.yaml"
    file.write_text(text)
    check = Feasibility(PROFILE.vehicle, PROFILE.sets["mission"], 0.0)
    found = in_words(check.excesses(load_scenario(str(file))))
    assert found.startswith(reason) and bool(found) is bool(reason)


def test_the_second_flight_is_compared_with_the_limits_of_its_time():
    """A limit that was lowered in the first flight is not checked there, but before the next."""
    parameters = PROFILE.sets["mission"]
    mission = Mission(load_scenario("hover"), parameters, vehicle=PROFILE.vehicle)
    state = np.zeros((3, 8))
    state[0, 2], state[0, 6:] = 0.285, mission.scenario.arm_start
    fresh = Readings(mocap_age=0.0, joint_age=0.0, controller_age=0.0, autopilot_age=0.0)
    mission.step(0.0, state, None, fresh)
    assert mission.start() == (True, "arming")
    mission.step(0.01, state, 0.01, fresh)
    mission.step(3.0, state, 0.01, fresh)
    mission.configure(replace(parameters, geofence_high=(5.0, 5.0, 0.6)))
    stamp = 3.0
    while not mission.output.done:  # disarmed on the ground
        stamp += 0.01
        mission.step(stamp, state, None, fresh)
    accepted, why = mission.start()
    assert not accepted and "z 1 m exceeds 0.6 m" in why


def test_the_pre_arm_report_has_the_reference():
    parameters = PROFILE.sets["mission"]
    strong = with_full_thrust(50.0)
    for name, passed in (("hover", True), ("ellipse", False)):
        mission = Mission(load_scenario(name), parameters, vehicle=strong)
        state = np.zeros((3, 8))
        state[0, 2], state[0, 6:] = 0.285, mission.scenario.arm_start
        mission.step(0.0, state, None)
        (line,) = [check for check in mission.preflight() if check.name == "reference"]
        assert line.passed is passed
        assert ("thrust 42.3 N exceeds" in mission.not_ready) is not passed
    mission.configure(
        replace(parameters, reference_thrust=45.0, reference_tilt=1.0, tilt_hold=1.04)
    )
    assert "thrust" not in mission.not_ready and "tilt 1.04 rad exceeds 1 rad" in mission.not_ready


@pytest.mark.parametrize(
    ("name", "place", "yaw", "complaint"),
    [
        ("quick_pick", (0.5, 0.0), 0.5, ""),
        ("quick_pick", (0.0, 0.7), 0.0, "tilt 0.465 rad exceeds 0.35 rad at 0.3 s"),
        ("quick_pick", (1.5, 1.0), 3.0, "tilt 0.9"),
        ("pick_and_place", (1.5, 0.0), 0.0, ""),  # in 2 s: a quarter of the acceleration
        ("pick_and_place", (2.0, 2.0), 0.0, "tilt 0.4"),
        ("circle_fast", (2.0, 2.0), 3.0, ""),  # its way there is as long as it takes
    ],
)
def test_moves_begin_near_their_place(name, place, yaw, complaint):
    """d m in T s, minimum snap: 7.51 d / T^2; 0.7 m in 1 s needs atan(5.26 / 9.81) = 0.49 rad,
    less as the climb begins."""
    mission = Mission(
        load_scenario(name), PROFILE.sets["mission"], vehicle=PROFILE.vehicle, compared=True
    )
    fresh = Readings(mocap_age=0.0, joint_age=0.0, controller_age=0.0, autopilot_age=0.0)
    state = np.zeros((3, 8))
    state[0, :3], state[0, 5], state[0, 6:] = (*place, 0.285), yaw, mission.scenario.arm_start
    mission.step(0.0, state, None, fresh)
    assert mission.not_ready.startswith("place: ") is bool(complaint)
    assert complaint in mission.not_ready
    assert bool(mission.not_ready) is bool(complaint)
    state[0, :3], state[0, 5] = (0.1, -0.1, 0.285), 0.1  # carried back
    mission.step(1.0, state, None, fresh)
    assert mission.start() == (True, "arming")
