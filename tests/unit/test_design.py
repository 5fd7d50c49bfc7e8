"""The design of gains: formulas worked by hand, and vehicles that it must serve."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import yaml
from designing import vehicles
from hypothesis import given
from hypothesis import strategies as st

from uam_control.profiles.profile import ProfileError, default_profile
from uam_control.vehicle import VehicleError, derived_parameters, load_description
from uam_lab.analysis.dynamics import Body
from uam_lab.cli import vehicle
from uam_lab.cli.main import main
from uam_lab.experiments.design import search
from uam_lab.experiments.design.criteria import DesignError, load_criteria
from uam_lab.experiments.design.facts import (
    Facts,
    inertias,
    largest_torque,
    noise_gains,
    standing_torque,
)
from uam_lab.experiments.design.gains import rate_loop, thrust_response
from uam_lab.experiments.margins.cases import missed
from uam_lab.experiments.margins.linear import Margins
from uam_lab.flights.vehicle.lab_file import template
from uam_sim_bridge.plant import Vehicle

QUAD = vehicles.Made("small", 1.0, 4, 0.16, 0.02, 2)
QUIET = np.zeros((3, 2, 2))


def facts(inertia=0.02, lag=0.1, torque=100.0, noise=QUIET):
    """Of a vehicle with the torque of a normalised torque 5 N m, dead times 10 ms and 10 ms."""
    three = np.ones(3)
    return Facts(
        inertia * three, three, {}, torque * three, 5.0 * three, lag * three,
        0.01, 0.01, noise, 0.01, 0.01, three,
    )  # fmt: skip


def test_rate_loop_that_only_its_dead_time_limits():
    """d = sqrt(1 + (0.5 / 20 ms x 100 ms)^2) = 2.6926; lambda_2 = (1 + d) / (4 x 0.81 x 110 ms)."""
    found = rate_loop(facts(), 0, load_criteria(), 1.0)
    d = math.sqrt(1.0 + 2.5**2)
    assert found.bandwidth == pytest.approx((1.0 + d) / (4.0 * 0.81 * 0.11))
    assert found.inertia == pytest.approx(0.02 * (1.0 + d))
    assert found.d == pytest.approx(0.02 * d / 5.0)
    assert found.stiffness == pytest.approx(5.0 * found.p)  # S K P = Mbar lambda_2
    assert found.stiffness == pytest.approx(found.inertia * found.bandwidth)
    assert found.i / found.p == pytest.approx(0.09 * found.bandwidth)
    assert "100 ms" in found.limit


def test_rate_loop_that_torque_limits():
    """0.45 x 1 N m = stiffness 0.5 lambda_2 0.15 rad; without D: lambda_2^2 = 0.45 / (J 0.075)."""
    found = rate_loop(facts(inertia=1.0, torque=1.0), 0, load_criteria(), 1.0)
    assert found.d == 0.0
    assert found.bandwidth == pytest.approx(math.sqrt(0.45 / 0.075), rel=1e-6)
    assert "torque" in found.limit


@given(st.floats(0.001, 1.0), st.floats(0.01, 0.12), st.floats(0.05, 50.0))
def test_a_rate_loop_keeps_its_damping_and_its_torque(inertia, lag, torque):
    criteria = load_criteria()
    found = rate_loop(facts(inertia, lag, torque), 0, criteria, 1.0)
    d = 5.0 * found.d / inertia
    # J T s^2 + J (1 + d) s + S P: damping (1 + d) / (2 sqrt(T S P / J))
    damping = (1.0 + d) / (2.0 * math.sqrt((lag + 0.01) * found.stiffness / inertia))
    assert damping >= 0.9 * (1.0 - 1e-9)
    assert found.stiffness * 0.5 * found.bandwidth * 0.15 <= 0.45 * torque * (1.0 + 1e-9)


@pytest.mark.parametrize("period", [0.004, 0.008])
def test_a_tick_makes_what_is_computed_at_once_half_of_it_late(period):
    """sqrt(2) / (2 pi 40 Hz) of the gyroscope's filter and half a tick; a state is one tick older,
    a joint's sample and torque are two. 1.5 in place of 0.5 made an S-500 of 8 ms err by 263 mm."""
    of = Facts.of(Vehicle.of(replace(load_description(), control_period=period)))
    assert of.dead == pytest.approx(0.005627 + 0.5 * period, abs=1e-6)
    assert of.seen == pytest.approx(1.5 * period)
    assert of.bus == pytest.approx(2.5 * period)


def test_noise_limits_the_gains():
    """Variance 1 for D = 1: a command of 1 % allows D = 0.01."""
    noise = np.zeros((3, 2, 2))
    noise[:, 1, 1] = 1.0
    found = rate_loop(facts(inertia=1.0, torque=1e6, noise=noise), 0, load_criteria(), 1.0)
    assert found.d == pytest.approx(0.01, rel=1e-6)
    assert "noise" in found.limit


def test_noise_without_filters():
    """P alone passes each sample: variance 1; D is a difference: 2 / dt^2, and -1/dt with P."""
    found = noise_gains(250.0, [0.0, 0.0, 0.0])
    expected = [[1.0, 250.0], [250.0, 2.0 * 250.0**2]]
    assert found[0] == pytest.approx(np.array(expected))


def test_torque_in_hover_of_the_s500():
    """Room 10.344 - 5.396 = 4.949 N of each rotor: 4 x 0.171 m x 4.949 N, and 4 x 0.016 m."""
    room = 8.549e-6 * 1100.0**2 - 2.2 * 9.81 / 4.0
    found = largest_torque(load_description())
    assert found == pytest.approx([4 * 0.171 * room] * 2 + [4 * 0.016 * room])


def test_torque_that_holds_a_level_vehicle_is_that_of_the_model():
    """MuJoCo's generalised force about the base against gravity; the rotors' middle is at x = 0."""
    made = Vehicle.load("s500_arm")
    body = Body(made)
    for arm in (made.description.stowed, (0.7, 0.7), (-0.5, 1.2)):
        body.place(np.array([*np.zeros(6), *arm]))
        mujoco.mj_forward(body.model, body.data)
        force = body.data.joint("base").qfrc_bias[3:6]
        assert standing_torque(made, arm) == pytest.approx(force, abs=1e-9)
        assert abs(force[1]) > 0.01


def test_a_vehicle_that_its_arm_turns_over_is_refused_at_once():
    """The stowed arm of the S-500 takes 0.16 N m in pitch; 1 % of the largest torque is 0.034."""
    criteria = load_criteria()
    criteria.authority.torque = [0.01, 0.01, 0.9]
    with pytest.raises(DesignError, match=r"stowed, arm at 0, 90 deg: level hover needs 0.162 N m"):
        search.design(load_description("s500_arm"), criteria)


@pytest.mark.parametrize(("offset", "payload", "said"), [
    # 7.5 mm of the arm + 80 mm x 1.772 kg / 2.2 kg
    (0.08, 0.05, r"stowed, arm at 0, 90 deg.* is 72.0 mm from the .* along x, 70.6 mm are"),
    # 63.9 mm without, with 0.15 x 2.2 kg at 139 mm (63.9 + 0.15 x 139) / 1.15; 70.6 / 1.15
    (0.07, 0.15, r"stowed, 0.33 kg, arm at.* is 73.8 mm from the .* along x, 61.4 mm are"),
])  # fmt: skip
def test_a_centre_of_mass_beside_the_rotors_is_refused_with_its_distance(offset, payload, said):
    """3.385 N m of the S-500 in hover, of which the law may have 0.45: 1.523 N m, 70.6 mm x 21.58 N
    without a payload. What a vehicle cannot hold is known before the search."""
    criteria, own = load_criteria(), load_description("s500_arm")
    criteria.payload = payload
    shift = {"base_offset": [offset, 0.0]}
    moved = replace(own, numbers=own.numbers | {"variation": own.numbers["variation"] | shift})
    with pytest.raises(DesignError, match=said):
        search.design(moved, criteria, pytest.fail)


def test_a_servo_that_friction_takes_is_refused_at_once(monkeypatch):
    """0.08 + 1.4 N m s/rad at 1 rad/s are 1.48 of 2.8 N m, more than half."""
    braked = search.chain_of(load_description("s500_arm"))._replace(damping=np.array([0.02, 1.4]))
    monkeypatch.setattr(search, "chain_of", lambda described: braked)
    with pytest.raises(
        DesignError, match=r"alpha_2: friction 0.08 N m, .* take 1.5 N m .*of 2.8 N m"
    ):
        search.design(load_description("s500_arm"), load_criteria())


def test_inertia_of_a_vehicle_over_the_poses():
    """The joint's inertia with all weight at the ends is what a pendulum has; poses are corners."""
    middle, joints, poses = inertias(Vehicle.load("s500_arm"))
    assert poses["stowed"] == pytest.approx([0.0, math.pi / 2.0])
    assert poses["most inertia"] == (0.0, 0.0)  # straight down is farthest from the body
    assert np.all(middle > [0.0165, 0.0186, 0.0250])  # of the bare body
    assert np.all(joints > 0.010)  # the servo's own


@pytest.mark.parametrize(("lag", "expected"), [
    (0.03, 0.0),  # faster than needed
    (0.1, 0.5 / (0.7 * 12.0) - 0.01),  # 0.5 rad at 0.7 of the estimator's 12 rad/s, seen 10 ms late
    (0.3, 0.1),  # a third
])  # fmt: skip
def test_lead_that_slow_rotors_get(lag, expected):
    own = load_description()
    described = replace(own, rotor=replace(own.rotor, lag_up=lag, lag_down=lag))
    assert thrust_response(described, facts(), load_criteria()) == pytest.approx(expected, rel=1e-3)


def test_effects_grow_with_the_vehicle():
    """Twice the radius: a rotor of 8 times the mass at half the speed, balanced to the same grade;
    twice the mass: twice the force, half the resistance."""
    effects = {
        "propeller_vibration": {"imbalance": 1e-6},
        "standing_load": {"force": [0.5, 0.0, -1.0], "torque": [0.0, 0.0, 0.1], "turning": 1.0},
        "battery_sag": {"capacity": 5.0, "resistance": 0.005, "electronics": 20.0},
    }
    made = vehicles.grown(vehicles.Made("large", 4.4, 4, 0.484, 0.02, 2), effects)
    assert made["propeller_vibration"]["imbalance"] == pytest.approx(16e-6)
    assert made["standing_load"]["force"] == pytest.approx([1.0, 0.0, -2.0])
    assert made["standing_load"]["torque"] == pytest.approx([0.0, 0.0, 0.4])
    assert made["standing_load"]["turning"] == 1.0
    assert made["battery_sag"]["resistance"] == pytest.approx(0.0025)


def test_criteria_of_a_file_replace_single_entries(tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text("margins: {delay: 0.08}\n")
    found = load_criteria(file)
    assert found.margins.delay == 0.08
    assert found.margins.gain == load_criteria().margins.gain
    file.write_text("margins: {delays: 0.08}\n")
    with pytest.raises(DesignError, match="delays"):
        load_criteria(file)
    file.write_text("margins: {delay: -1}\n")
    with pytest.raises(DesignError, match="not above 0"):
        load_criteria(file)


@pytest.fixture(scope="module")
def designed(tmp_path_factory):
    """A vehicle without gains whose design stands beside it."""
    file = vehicles.write(QUAD, tmp_path_factory.mktemp("vehicle"))
    bare = load_description(file)
    assert main(["vehicle", "design", str(file)]) == 0
    return file, bare


def test_a_vehicle_without_gains_names_the_command(designed):
    _, bare = designed
    with pytest.raises(ProfileError, match="uam vehicle design"):
        default_profile("modular", bare)
    with pytest.raises(VehicleError, match="uam vehicle design"):
        derived_parameters(bare)


def test_a_design_acts_beside_its_vehicle_and_keeps_its_margins(designed):
    described = load_description(designed[0])
    profile = default_profile("modular", described)
    assert missed(profile, [0.0, 0.05]) == ()
    attitude, gains = profile.sets["attitude_controller"], described.autopilot_gains
    assert gains["MC_ROLLRATE_K"] * gains["MC_ROLLRATE_P"] > 0.0
    # Mbar lambda_2 = S K P: the measured body rates cancel
    scale = Facts.of(Vehicle.of(described)).scale[0]
    stiffness = scale * gains["MC_ROLLRATE_K"] * gains["MC_ROLLRATE_P"]
    assert attitude.inertia[0] * attitude.lambda_2[0] == pytest.approx(stiffness, rel=2e-3)
    assert (designed[0].parent / "small_bode.png").stat().st_size > 10_000


def test_a_profile_of_another_vehicle_is_named_with_numbers(designed):
    """The S-500's profile on a vehicle of 1 kg and a sixth of its inertia."""
    described = replace(load_description(designed[0]), profiles={"modular": "s500"})
    (line,) = missed(default_profile("modular", described), [0.0])
    assert "s500 on small" in line
    assert "rad/s" in line or " ms" in line


@pytest.mark.long  # ten seconds of a search
def test_the_same_numbers_give_the_same_design(designed, tmp_path, monkeypatch, capsys):
    """The files are named so that the vehicle's file, in another folder, finds them."""
    monkeypatch.chdir(tmp_path)
    assert main(["vehicle", "design", str(designed[0]), "--out", "made"]) == 0
    for name in ("small_profile.yaml", "small_autopilot.yaml"):
        assert (tmp_path / "made" / name).read_text() == (designed[0].parent / name).read_text()
    assert f"{{modular: {tmp_path}/made/small_profile.yaml}}, auto" in capsys.readouterr().out


@pytest.mark.long  # ten seconds of a search
def test_a_vehicle_that_derives_flies_with_its_own_design_at_once(designed, tmp_path, capsys):
    """The gains that it derives no longer count, so nothing is asked of the user."""
    file = tmp_path / "other.yaml"
    file.write_text(f"derives: {designed[0]}\n")
    assert main(["vehicle", "design", str(file)]) == 0
    assert load_description(file).profile("modular") == str(tmp_path / "other_profile.yaml")
    assert "flies with these gains after" not in capsys.readouterr().out


def test_files_of_a_person_are_not_replaced(designed, tmp_path, capsys):
    own = tmp_path / "small_profile.yaml"
    own.write_text(yaml.safe_dump({"mission": {"ros__parameters": {}}}))
    assert main(["vehicle", "design", str(designed[0]), "--out", str(tmp_path)]) == 2
    assert "small_profile.yaml is not a design's" in capsys.readouterr().err


def test_margins_that_no_gains_keep_are_refused(designed, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(search, "ROUNDS", 2)
    criteria = tmp_path / "criteria.yaml"
    criteria.write_text("margins: {peak: 1.0001}\n")
    asked = ["vehicle", "design", str(designed[0]), "--criteria", str(criteria)]
    assert main([*asked, "--out", str(tmp_path)]) == 2
    assert "no gains" in capsys.readouterr().err


def test_a_joint_whose_link_falls_over_gets_faster_other_loops_slower():
    """6 dB down are asked for; an upright link with 4 dB is 0.92 too slow, one with 3 dB up not."""
    wanted = load_criteria().margins
    good = Margins(20.0, 60.0, 12.0, math.inf, 0.1, 3.0, 1.3)
    falls = replace(good, gain_down=4.0)
    assert search.shortfall(good, wanted, joint=True) is None
    assert search.shortfall(falls, wanted, joint=True).factor == pytest.approx(1.0 / 0.92)
    assert search.shortfall(falls, wanted, joint=False).factor == 0.92
    assert search.shortfall(replace(falls, gain=3.0), wanted, joint=True).factor == 0.92

    made = search.Search(load_description(), load_criteria())
    before = made.bandwidths()
    made.mend({"alpha_1": search.Fault("falls", 1.0 / 0.92), "roll": search.Fault("late")})
    after = made.bandwidths()
    assert after.arm / before.arm == pytest.approx([1.0 / 0.92, 1.0])
    assert after.attitude / before.attitude == pytest.approx([0.92, 0.92, 1.0])


def test_the_rate_loop_is_mended_before_the_loops_around_it():
    """With 20 dB asked for, roll lacks gain margin, too; and one point tells enough."""
    criteria = load_criteria()
    criteria.margins.gain = 20.0
    found = search.Search(load_description(), criteria).evaluated()
    assert {*found.faults} == {search.RATES}
    assert len(found.cases) == 1
    roll = found.cases[0].analysis.loops["roll"][1]
    assert search.shortfall(roll, criteria.margins, joint=False) is not None


def test_a_rate_loop_that_is_unstable_is_mended_before_the_loops_around_it(tmp_path):
    """At 8 ms roll, pitch, x, y and the arm lack margins at first; slower, they still would."""
    (made,) = (one for one in vehicles.VEHICLES if one.name == "x8_2500")
    described = replace(load_description(vehicles.write(made, tmp_path)), control_period=0.008)
    found = search.Search(described, load_criteria()).evaluated()
    assert not found.cases[0].analysis.stable
    assert {*found.faults} == {search.RATES}


def test_an_attitude_that_half_the_motors_do_not_hold_becomes_slower():
    """Slower rates would need a slower attitude, too, without end."""
    criteria = load_criteria()
    criteria.attitude = 1.5
    found = search.Search(load_description(), criteria).evaluated()
    assert {*found.faults} == {"roll"}
    assert "motors down" in found.summary


def test_a_real_vehicle_without_its_margins_does_not_start(tmp_path, capsys, monkeypatch):
    lab, line = tmp_path / "lab.yaml", "profile s500 on s500_arm, no payload: unstable"
    lab.write_text(template())
    monkeypatch.setattr(vehicle, "missed_margins", lambda settings: (line,))
    assert main(["vehicle", "--config", str(lab)]) == 2
    assert line in capsys.readouterr().err


def test_margins_that_contradict_each_other_end_the_search(monkeypatch, tmp_path):
    described = load_description(vehicles.write(QUAD, tmp_path))
    faults = {True: search.Fault("too fast"), False: search.Fault("too slow", 1.0 / search.STEP)}

    def evaluated(self):
        fast = self.shares[-1] == 1.0
        return search.Design(described, None, (), {described.coordinates[-1]: faults[fast]})

    monkeypatch.setattr(search.Search, "evaluated", evaluated)
    with pytest.raises(DesignError, match=r"keep all margins: .*too slow, or .*too fast"):
        search.design(described, load_criteria())
