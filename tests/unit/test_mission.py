"""The sequence of a mission."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.mission import Mission, MissionParameters, StartParameters, load_scenario
from uam_control.supervision import Authority, OperatorCommand, Readings, State

START = np.array([0.0, 0.0, 0.28, 0.0, 0.0, 0.0, 0.0, np.pi / 2])


AUTOMATIC = StartParameters(auto_start=True)
KNOWN = Readings(mocap_age=0.01, joint_age=0.01, controller_age=0.01, autopilot_age=0.1)


class Flight:
    """Steps a mission with a state equal to the reference."""

    def __init__(self, name="hover", armed_at=1.0, start=AUTOMATIC, **parameters):
        self.mission = Mission(load_scenario(name), MissionParameters(**parameters), start)
        self.state = np.zeros((3, 8))
        self.state[0] = START
        self.armed_at, self.stamp = armed_at, 0.0
        self.authority, self.readings = Authority(), KNOWN

    def step(self, follow=True):
        self.stamp += 0.01
        armed = self.armed_at if self.stamp >= self.armed_at else None
        output = self.mission.step(self.stamp, self.state, armed, self.readings, self.authority)
        if follow and output.flying:
            self.state[:2] = output.reference[:2]
            self.state[0, 2] = max(self.state[0, 2], START[2])
            self.state[1, 2] *= self.state[0, 2] > START[2]
        return output

    def until(self, condition, limit=40.0):
        while not condition(output := self.step()):
            assert self.stamp < limit, f"still {output.phase} at {self.stamp}"
        return output


def test_sequence_waits_for_arming_flies_and_lands():
    flight = Flight()
    output = flight.until(lambda o: o.flying)
    assert flight.stamp == pytest.approx(1.5, abs=0.011)  # armed at 1.0 + takeoff_delay
    assert output.arm and output.time == 0.0
    assert flight.until(lambda o: o.phase == "hover").reference[0, 2] == pytest.approx(1.0)
    output = flight.until(lambda o: o.phase == "landed")
    assert not output.flying and not output.arm and not output.abort_reason
    assert not flight.step().done
    flight.until(lambda o: o.done)


def disturb(flight, entry, value, seconds):
    """Continue for a while with one wrong entry of the state."""
    for _ in range(round(seconds / 0.01)):
        output = flight.step()
        flight.state[entry] = value
    return output


@pytest.mark.parametrize(
    ("entry", "value", "reason"),
    [
        ((0, 0), 4.0, "position error 4.00 m exceeds 3 m"),
        ((0, 3), 1.5, "tilt 1.50 rad exceeds 1.05 rad"),
        ((0, 1), np.nan, "estimate is not finite"),
    ],
)
def test_hard_limits_in_flight_start_failsafe_without_disarming(entry, value, reason):
    flight = Flight()
    flight.until(lambda o: o.time > 4.0)
    output = disturb(flight, entry, value, 0.2)
    assert output.state is State.FAILSAFE and output.abort_reason == output.cause == reason
    assert not output.flying and output.arm and not output.done
    assert np.all(np.isfinite(output.reference))
    flight.armed_at = np.inf  # the autopilot has landed and disarmed
    output = flight.until(lambda o: o.done)
    assert output.phase == "aborted" and not output.arm


def test_a_vehicle_off_its_path_holds_then_lands_at_its_position():
    flight = Flight()
    flight.until(lambda o: o.time > 4.0)
    assert disturb(flight, (0, 0), 1.2, 0.3).state is State.FLYING  # shorter than hold_after
    output = disturb(flight, (0, 0), 1.2, 0.4)
    assert output.state is State.HOLDING and output.phase == "hold" and not output.abort_reason
    output = disturb(flight, (0, 0), 1.2, 5.1)
    assert output.state is State.LANDING and output.phase == "land"
    assert output.abort_reason == "position error 1.20 m exceeds 1 m for 5 s"
    output = disturb(flight, (0, 0), 1.2, 15.0)
    assert output.reference[0, 0] == pytest.approx(1.2, abs=0.02) and output.phase == "landed"
    assert flight.until(lambda o: o.done).abort_reason


def test_hold_stops_the_scenario_and_resume_continues_it():
    flight = Flight("pick_and_place")
    flight.until(lambda o: o.time > 10.0)
    assert flight.mission.request(OperatorCommand.RESUME) == (False, "refused: not while flying")
    assert flight.mission.request(OperatorCommand.HOLD) == (True, "hold by command")
    assert flight.step().state is State.HOLDING
    flight.until(lambda o: o.time > 13.0)
    held = flight.step().reference.copy()
    np.testing.assert_array_equal(held[1:], 0.0)
    flight.until(lambda o: o.time > 20.0)
    np.testing.assert_array_equal(flight.step().reference, held)
    assert flight.mission.request(OperatorCommand.RESUME)[0]
    assert flight.step().phase == "approach"
    output = flight.until(lambda o: o.done, limit=120.0)
    assert not output.abort_reason and output.phase == "landed"
    assert [(c.source, c.target) for c in flight.mission.changes] == [
        (State.GROUNDED, State.TAKING_OFF),
        (State.TAKING_OFF, State.FLYING),
        (State.FLYING, State.HOLDING),
        (State.HOLDING, State.FLYING),
        (State.FLYING, State.LANDING),
        (State.LANDING, State.DISARMED),
    ]


def test_land_descends_from_the_current_position_and_stows_the_arm():
    flight = Flight("pick_and_place")
    flight.until(lambda o: o.time > 8.0)
    x = flight.state[0, 0]
    assert flight.mission.request(OperatorCommand.LAND)[0]
    output = flight.until(lambda o: o.phase == "landed", limit=60.0)
    assert output.abort_reason == "land by command" and output.time < 18.0
    assert output.reference[0, 0] == pytest.approx(x, abs=0.06)
    assert output.reference[0, 6:] == pytest.approx([0.0, np.pi / 2])


def test_disarming_in_the_air_is_refused_and_on_the_ground_done():
    flight = Flight()
    assert flight.mission.request(OperatorCommand.DISARM) == (False, "no state of the vehicle yet")
    flight.until(lambda o: o.time > 4.0)
    refused = (False, "refused: flying and not on the ground: land first")
    assert flight.mission.request(OperatorCommand.DISARM) == refused
    assert flight.step().arm
    waiting = Flight()
    waiting.step()
    assert waiting.mission.request(OperatorCommand.DISARM)[0]
    output = waiting.step()
    assert not output.arm and output.state is State.DISARMED and output.time < 0.0
    assert waiting.mission.switch_magnet(True)[0] is False


def test_the_magnet_command_holds_until_the_scenario_switches():
    flight = Flight("pick_and_place")
    flight.until(lambda o: o.time > 10.0)
    assert flight.mission.switch_magnet(True) == (
        True,
        "magnet on until the scenario switches it next",
    )
    assert flight.step().magnet
    assert flight.until(lambda o: o.time > 36.0).magnet
    flight.mission.switch_magnet(False)
    assert not flight.step().magnet
    assert not flight.until(lambda o: o.time > 71.0, limit=80.0).magnet


def test_no_take_off_beyond_a_limit():
    flight = Flight(armed_at=np.inf)
    flight.state[0, 3] = 1.2  # lying on its side
    for _ in range(300):
        output = flight.step()
    assert (
        output.state is State.GROUNDED and "tilt" in flight.mission.checks.beyond and not output.arm
    )
    flight.state[0, 3] = 0.0
    assert flight.until(lambda o: o.arm).state is State.GROUNDED
    flight.armed_at, flight.state[0, 3] = flight.stamp, 1.2
    for _ in range(300):
        output = flight.step()
    assert output.state is State.GROUNDED and output.arm
    flight.state[0, 3] = 0.0
    assert flight.until(lambda o: o.flying).state is State.TAKING_OFF


def test_disarming_in_flight_ends_the_mission():
    flight = Flight()
    flight.until(lambda o: o.time > 4.0)
    flight.armed_at = np.inf
    output = flight.step()
    assert "disarmed" in output.abort_reason and output.phase == "aborted"


MANUAL = StartParameters()


def test_nothing_arms_before_the_start_command():
    flight = Flight(start=MANUAL, armed_at=np.inf)
    assert flight.mission.start() == (False, "refused: no state of the vehicle yet")
    assert flight.mission.preflight() == ()
    for _ in range(500):
        output = flight.step()
        assert not output.arm and output.state is State.GROUNDED
    assert output.cause == "waiting for the start"
    assert flight.mission.start() == (True, "arming")
    assert flight.step().arm
    assert flight.mission.start() == (False, "refused: not while grounded")
    flight.armed_at = flight.stamp
    flight.until(lambda o: o.flying)
    assert flight.mission.start() == (False, "refused: not while taking off")


def test_a_red_check_refuses_the_start_in_words():
    flight = Flight(start=MANUAL, armed_at=np.inf)
    flight.readings = Readings(joint_age=0.01, controller_age=0.01, autopilot_age=0.1)
    flight.state[0, 7] += 0.4
    flight.step()
    accepted, words = flight.mission.start()
    assert not accepted and words == (
        "refused: mocap: unknown (at most 0.1 s); arm: 0.4 rad (at most 0.3 rad from its start)"
    )
    assert not flight.step().arm
    flight.readings, flight.state[0, 7] = KNOWN, START[7]
    flight.step()
    assert flight.mission.start()[0]


def test_after_the_end_start_begins_the_next_flight():
    flight = Flight(start=MANUAL, armed_at=np.inf)
    for _ in range(2):
        flight.step()
        assert flight.mission.start() == (True, "arming")
        flight.armed_at = flight.stamp
        flight.until(lambda o: o.phase == "landed", limit=np.inf)
        flight.armed_at = np.inf
        assert flight.mission.start()[0] is False  # the flight is not over yet
        flight.until(lambda o: o.done, limit=np.inf)
        flight.state[:], flight.state[0] = 0.0, START
    assert not flight.step().arm
    events = [change.target for change in flight.mission.changes]
    assert events.count(State.TAKING_OFF) == 1  # of the second flight


def test_a_dry_run_has_a_reference_at_the_first_pose_and_never_arms():
    flight = Flight(start=StartParameters(auto_start=True, dry_run=True), armed_at=np.inf)
    flight.state[0, :6] = 0.3, -0.2, 1.1, 0.2, -0.1, 0.5
    for _ in range(300):
        output = flight.step(follow=False)
        assert output.flying and not output.arm and output.phase == "dry run"
    assert output.reference[0, :6] == pytest.approx([0.3, -0.2, 1.1, 0.0, 0.0, 0.5])
    flight.state[0, 3] = 0.4  # tilted in the hand: the reference stays
    assert flight.step(follow=False).reference[0, 3] == 0.0
    assert flight.mission.start() == (False, "refused: dry run, nothing is armed")


PILOT = Authority("the pilot, in POSITION")


def released(at=25.0, **parameters):
    """A flight that the pilot took over at `at` [s] and flew 1 m to the side."""
    flight = Flight("pick_and_place", **parameters)
    flight.until(lambda o: o.time > at, limit=100.0)
    flight.authority = PILOT
    assert flight.step().state is State.RELEASED
    flight.state[0, 1] += 1.0
    flight.state[1] = 0.0
    for _ in range(300):
        output = flight.step()
    assert output.phase == "released" and not output.flying and output.arm
    assert output.cause == "the pilot, in POSITION, has control" and not output.abort_reason
    return flight


def test_a_released_vehicle_is_followed_and_the_clock_stands():
    flight = released()
    kept = flight.mission._guidance.scenario_time
    assert 25.0 < kept < 27.0
    for _ in range(100):
        flight.state[0, 0] += 0.01
        output = flight.step()
        assert output.reference[0, 0] == flight.state[0, 0]
        np.testing.assert_array_equal(output.reference[1:, :6], 0.0)
    assert flight.mission._guidance.scenario_time == kept


def test_resume_asks_once_per_command_and_the_scenario_goes_on():
    flight = released()
    assert flight.mission.request(OperatorCommand.RESUME) == (True, "resume by command")
    assert flight.step().regains == 1 and flight.step().regains == 1
    flight.authority, pose = Authority(), flight.state[0].copy()
    output = flight.step()
    assert output.state is State.HOLDING and output.flying
    np.testing.assert_allclose(output.reference[0, :6], pose[:6], atol=1e-5)
    assert flight.step().state is State.FLYING
    output = flight.until(lambda o: o.done, limit=200.0)
    assert output.phase == "landed" and not output.abort_reason


@pytest.mark.parametrize(
    "place, speed, said",
    [
        ([4.0, 0.0, 1.0], [-3.0, 0.0, 0.0], ""),
        ([3.0, 0.0, 1.0], [3.0, 0.0, 0.0], "in x before it stops: slow down"),
        ([0.0, -5.4, 1.0], [0.0, 0.0, 0.0], "leave the geofence by 0.4 m in y"),
        ([0.0, 0.0, 5.5], [0.0, 0.0, 2.0], "in z"),
    ],
)
def test_control_is_not_taken_where_the_vehicle_would_leave_the_geofence(place, speed, said):
    """Box of the default: 5 m to each side, 6 m high."""
    flight = released()
    flight.state[0, :3], flight.state[1, :3] = place, speed
    flight.step()
    accepted, answer = flight.mission.request(OperatorCommand.RESUME)
    assert accepted == (not said) and said in answer
    assert flight.step().state is State.RELEASED and flight.step().regains == accepted


def test_the_pilots_switch_alone_is_a_hold_that_waits():
    flight = released()
    flight.authority = Authority()
    assert flight.step().state is State.HOLDING
    for _ in range(3000):
        output = flight.step()
    assert output.state is State.HOLDING and output.regains == 0
    assert output.reference[0, 1] == pytest.approx(1.0, abs=0.1)
    assert flight.mission.request(OperatorCommand.RESUME)[0]
    assert flight.until(lambda o: o.done, limit=200.0).phase == "landed"


def test_a_landing_that_the_pilot_ended_does_not_pull_the_vehicle_down():
    flight = Flight("pick_and_place")
    flight.until(lambda o: o.time > 25.0)
    flight.mission.request(OperatorCommand.LAND)
    flight.until(lambda o: o.state is State.LANDING and o.reference[0, 2] < 0.7)
    flight.authority = PILOT
    flight.step()
    flight.state[0, 2], flight.state[1] = 1.5, 0.0
    for _ in range(1500):
        flight.step()
    flight.authority = Authority()
    for _ in range(300):
        output = flight.step()
    assert output.state is State.HOLDING and output.abort_reason == "land by command"
    assert output.reference[0, 2] == pytest.approx(1.5, abs=0.05)
    assert flight.mission.request(OperatorCommand.RESUME)[0]
    output = flight.until(lambda o: o.done, limit=200.0)
    assert output.phase == "landed" and not output.abort_reason  # the scenario was flown


def test_the_magnet_of_a_released_vehicle_follows_the_policy():
    assert released(at=50.0).step().magnet
    assert not released(at=50.0, magnet_released="release").step().magnet


@pytest.mark.parametrize(
    ("name", "age", "gap", "yields"),
    [
        ("quick_pick", 0.6, 0.0, True),
        ("quick_pick", 0.4, 0.0, False),
        ("quick_pick", 0.6, 0.6, False),  # no ticks meanwhile: nothing could be heard
        ("arm_motions", 0.6, 0.0, False),
    ],
)
def test_the_arm_gives_way_above_a_stand_when_the_bridge_is_silent(name, age, gap, yields):
    flight = Flight(name, grasp_checks="off")
    flight.until(lambda o: o.time > 8.0)
    flight.readings = Readings(
        mocap_age=0.01, joint_age=0.01, controller_age=0.01, autopilot_age=age
    )
    flight.state[0, 7] += 0.05  # the stand presses on it
    flight.stamp += gap
    output = flight.step(follow=False)
    assert (output.reference[0, 7] == flight.state[0, 7]) == yields


def test_an_arm_away_from_its_reference_stays_where_it_is_when_a_released_vehicle_stands():
    """A reference that moved back to it from where it was levered the vehicle up, to 26 degrees."""
    flight = released()
    flight.authority = Authority("the pilot, in LAND", lands=True)
    flight.state[1, 2] = -0.7
    for _ in range(30):
        flight.step()
    flight.state[0, 6:], flight.state[1, 2] = (-0.9, -1.0), 0.0  # pushed by the ground
    for _ in range(300):
        reference = flight.step().reference
        assert reference[0, 6:].tolist() == [-0.9, -1.0] and not reference[1:, 6:].any()


@pytest.mark.parametrize(("scenario", "at"), [("pick_and_place", 25.0), ("two_finger", 36.5)])
def test_a_landing_by_command_does_not_come_down_on_a_stand(scenario, at):
    """A hexacopter landed on it and fell. From 0.2 m beside the stand to 0.7 m; from the table.

    In a hurry a vehicle that lands because its setpoints are late swayed to 51 degrees.
    """
    flight, speeds = Flight(scenario), []
    flight.until(lambda o: o.time > at)
    begin = flight.state[0, :2].copy()
    flight.mission.request(OperatorCommand.LAND)

    def is_low(output):
        speeds.append(np.linalg.norm(output.reference[1, :3]))
        return output.state is State.LANDING and output.reference[0, 2] < 0.4

    output = flight.until(is_low, 60.0)
    assert np.linalg.norm(output.reference[0, :2] - begin) > 0.4
    assert max(speeds) < 1.01 * MissionParameters().travel_speed


def on_path(at):
    """The place (3,) of the path, which rests there."""
    return Flight("pick_and_place").until(lambda o: o.time > at).reference[0, :3].copy()


def regained(lower):
    """By command."""
    flight = released(at=20.0)
    flight.state[0, :3] = on_path(20.0) - [0.0, 0.0, lower]
    flight.step()
    assert flight.mission.request(OperatorCommand.RESUME)[0]
    flight.step()
    flight.authority = Authority()
    return flight


def after_failsafe(lower):
    """Poses fail and agree again."""
    flight = Flight("pick_and_place")
    flight.until(lambda o: o.time > 20.0)
    flight.readings = Readings(mocap_age=9.0)
    flight.until(lambda o: o.state is State.FAILSAFE)
    flight.state[0, :3] = on_path(20.0) - [0.0, 0.0, lower]
    flight.readings = KNOWN
    return flight


@pytest.mark.parametrize("made", [regained, after_failsafe])
@pytest.mark.parametrize(("lower", "away"), [(0.05, False), (0.2, True)])
def test_below_its_path_beside_a_stand_it_leaves_level_before_it_climbs(made, lower, away):
    """Straight up the arm is caught under the stand's top: lost, torn loose at 1.6 m of error."""
    flight, path = made(lower), on_path(20.0)
    places = np.array([flight.step().reference[0, :3].copy() for _ in range(1500)])
    climbs = int(np.argmax(places[:, 2] > path[2] - 0.9 * lower))
    beside = np.linalg.norm(places[climbs, :2] - path[:2])
    assert bool(beside > 0.3) is away and places[:, 2].max() > path[2] - 0.01


def test_a_flight_that_the_pilot_lands_is_over():
    flight = released()
    flight.state[0, 2] = START[2]
    flight.authority = PILOT._replace(landed=True)
    flight.step()
    assert flight.mission.request(OperatorCommand.RESUME) == (
        False,
        "refused: on the ground: disarm, then start a new flight",
    )
    flight.armed_at = np.inf
    output = flight.step()
    assert (
        output.state is State.DISARMED
        and not output.arm
        and output.abort_reason
        == ("the autopilot disarmed while released: the pilot, in POSITION, has control")
    )


STRANGE = st.floats(-10.0, 10.0) | st.sampled_from([np.nan, np.inf, -np.inf])
HAPPENINGS = st.tuples(
    st.integers(1, 300), st.integers(0, 2), st.integers(0, 7), STRANGE,
    st.sampled_from([None, *OperatorCommand]), st.booleans(), st.booleans(),
)  # fmt: skip


@settings(deadline=None, max_examples=20)
@given(st.lists(HAPPENINGS, max_size=12))
def test_a_reference_is_finite_and_never_jumps_for_any_events(happenings):
    flight = Flight("pick_and_place", armed_at=0.0)
    arming, before = True, None
    for ticks, row, column, value, command, magnet, well in happenings:
        for _ in range(ticks):
            output = flight.step()
            assert np.all(np.isfinite(output.reference)) and np.isfinite(output.time)
            assert arming or not output.arm
            arming = output.arm
            if before is not None and output.flying:
                assert np.max(np.abs(output.reference[0] - before)) < 0.02
            before = output.reference[0].copy() if output.flying else None
        if command is not None:
            flight.mission.request(command)
        flight.mission.switch_magnet(magnet)
        flight.state[row, column] = value
        if well:
            flight.state[:] = output.reference
