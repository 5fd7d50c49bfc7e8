"""Margins worked by hand, blocks and their connection, and the model of the stack."""

import math
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.estimation.filters import low_pass_step
from uam_control.profiles.profile import default_profile, load_profile
from uam_control.vehicle import load_description
from uam_lab.cli.main import main
from uam_lab.experiments.margins.cases import verdict
from uam_lab.experiments.margins.linear import (
    IN,
    LinearBlock,
    common_delay,
    delay,
    join,
    linearise,
    margins,
)
from uam_lab.experiments.margins.loops import analyse, step_response
from uam_lab.experiments.margins.plant_model import plant_model, rotor_model
from uam_lab.experiments.margins.pose_delay import pose_delay, remaining
from uam_lab.experiments.margins.stack_model import stack_model
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.actuators import Rotors

OMEGA = np.geomspace(0.01, 400.0, 4000)


@pytest.mark.parametrize(("gain", "late"), [(2.0, 0.1), (5.0, 0.05), (0.5, 0.4)])
def test_integrator_with_delay(gain, late):
    """L = k e^(-s T) / s: crossover k, phase margin 90 deg - k T, gain margin pi / (2 k T)."""
    found = margins(OMEGA, gain / (1j * OMEGA) * np.exp(-1j * OMEGA * late))
    assert found.crossover == pytest.approx(gain, rel=1e-3)
    assert found.phase == pytest.approx(90.0 - math.degrees(gain * late), abs=0.05)
    expected = 20.0 * math.log10(math.pi / (2.0 * gain * late))
    assert found.gain == pytest.approx(expected, abs=0.02)
    assert found.gain_down == math.inf
    assert found.delay == pytest.approx(0.5 * math.pi / gain - late, rel=2e-3)


def test_bandwidth_of_a_first_order_loop():
    found = margins(OMEGA, 4.0 / (1j * OMEGA))
    assert found.bandwidth == pytest.approx(4.0 / (2.0 * math.pi), rel=1e-3)
    assert found.peak == pytest.approx(1.0, abs=1e-3)


def test_a_loop_that_must_not_lose_gain():
    """L = 4 (s + 1)^2 / s^3 has -180 deg at 1 rad/s with |L| = 8: the gain may fall by 8."""
    s = 1j * OMEGA
    found = margins(OMEGA, 4.0 * (s + 1.0) ** 2 / s**3)
    assert found.gain_down == pytest.approx(20.0 * math.log10(8.0), abs=0.01)
    assert found.gain == math.inf


def test_two_loops_that_are_delayed_together():
    """Two integrators that drive each other: eigenvalues ± j k / s, so pi / 2 is the phase."""
    gain = 3.0
    matrix = np.array([[1.0, 0.0], [0.0, 2.0]])
    loops = gain / (1j * OMEGA)[:, None, None] * matrix
    assert common_delay(OMEGA, loops) == pytest.approx(0.5 * math.pi / (2.0 * gain), rel=1e-3)
    # the eigenvalue 2 + j k of [[2, -k], [k, 2]] / s needs the least delay
    turned = np.array([[2.0, 1.0], [-1.0, 2.0]]) / (1j * OMEGA)[:, None, None]
    size, angle = math.sqrt(5.0), math.atan2(1.0, 2.0)
    expected = (0.5 * math.pi - angle) / size
    assert common_delay(OMEGA, turned) == pytest.approx(expected, rel=1e-3)


def test_join_closes_a_loop():
    """x+ = x + u, u = -k x one tick later: z^2 - z + k = 0."""
    k = 0.2
    one = np.ones((1, 1))
    plant = LinearBlock(one, one, one, 0.0 * one, ("u",), ("x",))
    law = LinearBlock(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), -k * one, ("seen",), ("u",)
    )
    blocks = [plant, delay(["x"], ["seen"], 1), law]
    closed = join(blocks, added=["u"])
    assert closed.inputs == (IN + "u",)
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(closed.a)), np.sort(np.roots([1, -1, k])))
    z = np.exp(1j * np.array([0.1, 0.5, 2.0]))
    # the response of the open one with its sensitivity
    through = closed.only([IN + "u"], ["u"]).response(z)[:, 0, 0]
    np.testing.assert_allclose(through, -k / (z * (z - 1.0)) / (1.0 + k / (z * (z - 1.0))))
    with pytest.raises(ValueError, match="two outputs"):
        join([plant, plant])


def test_a_delay_of_no_tick_is_a_wire():
    block = delay(["a", "b"], ["c", "d"], 0)
    np.testing.assert_array_equal(block.simulate(np.eye(2)), np.eye(2))
    later = delay(["a", "b"], ["c", "d"], 2).simulate(np.vstack([np.eye(2), np.zeros((2, 2))]))
    np.testing.assert_array_equal(later, np.vstack([np.zeros((2, 2)), np.eye(2)]))


def test_linearised_filter():
    """x+ = keep x + (1 - keep) u, and the output is the new x."""
    state, cutoff, dt = np.zeros(1), 3.0, 0.004

    def step(given):
        low_pass_step(given, cutoff, dt, state)
        return [2.0 * state[0] + given[0] ** 2]

    block = linearise(step, [[state]], ["u"], ["y"], np.array([0.0]))
    keep = math.exp(-2.0 * math.pi * cutoff * dt)
    np.testing.assert_allclose(block.a, [[keep]], atol=1e-9)
    np.testing.assert_allclose(block.b, [[1.0 - keep]], atol=1e-9)
    np.testing.assert_allclose(block.c, [[2.0 * keep]], atol=1e-9)
    np.testing.assert_allclose(block.d, [[2.0 * (1.0 - keep)]], atol=1e-9)
    assert state[0] == 0.0


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle.load()


def test_rotor_with_one_lag_is_that_lag(vehicle):
    numbers = vehicle.numbers["rotors"] | {"lag_up": 0.03, "lag_down": 0.03}
    rotors = Rotors(numbers, 0.002)
    thrust = 5.0
    command, slope, lag = rotor_model(rotors, thrust, 0.002)
    full, factor = rotors.constants[1], numbers["curve_factor"]
    assert full * (factor * command**2 + (1.0 - factor) * command) == pytest.approx(thrust)
    assert slope == pytest.approx(full * (2.0 * factor * command + 1.0 - factor), rel=1e-3)
    # the plant applies the speed at the end of a physics step during that step: half a step less
    behind = math.atan(0.03 * 20.0) - 20.0 * 0.001
    assert lag == pytest.approx(math.tan(behind) / 20.0, rel=0.01)
    both = rotor_model(Rotors(vehicle.numbers["rotors"], 0.002), thrust, 0.002)[2]
    assert 0.0125 < both < 0.025


@pytest.mark.parametrize("payload", [0.0, 0.3])
def test_rigid_body_in_hover(vehicle, payload):
    """All rotors together lift the mass; a tilted vehicle accelerates with g times the angle."""
    block, hover = plant_model(vehicle, payload, vehicle.description.stowed)
    mass = 2.2 + payload
    assert hover.weight == pytest.approx(9.81 * mass)
    period, steps = vehicle.description.control_period, 300
    motors = np.zeros((steps, len(block.inputs)))
    motors[:, :4] = 0.01
    moved = block.simulate(motors)
    numbers = vehicle.numbers["rotors"]
    full = numbers["thrust_coefficient"] * numbers["speed_max"] ** 2
    slope = full * (2.0 * 0.3 * hover.command + 0.7)
    late = moved[:, block.outputs.index("true.z_dot")]
    gained = (late[-1] - late[-101]) / (100 * period)
    drag = 0.2 * late[-51] / mass
    assert gained == pytest.approx(4.0 * 0.01 * slope / mass - drag, rel=0.02)


def test_law_in_the_model_has_the_gains_of_its_equation(vehicle):
    """tau_p of z = -Mbar (lambda_1 + rho p12 / varpi) e inside the boundary layer, eq. (8)."""
    profile = default_profile("modular", vehicle.description)
    gains = {"position": np.array([0.5, 0.0, 0.0, 0.0, 0.1])}
    stack = stack_model(profile, vehicle, gains=gains)
    (law,) = (block for block in stack.blocks if "setpoint.thrust" in block.outputs
              and "state.z" in block.inputs)  # fmt: skip
    p = profile.sets["position_controller"]
    _, p12, p22 = p.lyapunov_matrix()
    extra = 0.6 / p.varpi
    stiffness = p.inertia[2] * (p.lambda_1[2] + extra * p12[2])
    damping = p.inertia[2] * (p.lambda_2[2] + extra * p22[2])
    row = law.outputs.index("setpoint.thrust")
    by_z, by_rate = (law.d[row, law.inputs.index(f"state.z{end}")] for end in ("", "_dot"))
    # the integral action adds a step of its own
    assert by_z / by_rate == pytest.approx(stiffness / damping, rel=0.01)
    rotors = vehicle.numbers["rotors"]
    full = 4.0 * rotors["thrust_coefficient"] * rotors["speed_max"] ** 2
    # thrust command with THR_MDL_FAC: the thrust is proportional to the command
    assert by_z == pytest.approx(-stiffness / full, rel=0.01)


def test_estimate_of_the_base_is_exact_while_the_sensors_agree(vehicle):
    """Therefore the latency of motion capture is not in the loops of the model."""
    profile = default_profile("modular", vehicle.description)
    estimator = StateEstimator(profile.sets["state_estimator"], 2)
    assert isinstance(profile.sets["state_estimator"], EstimatorParameters)
    period, gravity = 0.004, np.array([0.0, 0.0, 9.81])
    level, late, poses = np.array([1.0, 0.0, 0.0, 0.0]), 3, []
    estimator.joints(0.0, np.zeros(2), np.zeros(2))
    worst = 0.0
    for k in range(2000):
        time = k * period
        position = np.array([0.1 * math.sin(3.0 * time), 0.0, 0.0])
        # mean acceleration of the last period, as an accelerometer that averages
        before = 0.3 * math.cos(3.0 * (time - period))
        force = gravity + [(0.3 * math.cos(3.0 * time) - before) / period, 0.0, 0.0]
        poses.append((time, position))
        if k >= late and k % 2 == 0:
            estimator.mocap(*poses[k - late], level)
        estimator.imu(time, np.zeros(3), force)
        state = estimator.update()
        if k > 1000:
            worst = max(worst, abs(state[0, 0] - position[0]))
    assert worst < 1e-3  # of 0.1 m


def test_analysis_of_the_profile(vehicle):
    """A late setpoint takes its delay from the margin, and the steps end at one."""
    profile = default_profile("modular", vehicle.description)
    stack = stack_model(profile, vehicle)
    found = analyse(stack)
    later = analyse(stack_model(profile, vehicle, late_setpoints=2))
    assert later.setpoint_delay == pytest.approx(found.setpoint_delay - 0.008, abs=2e-4)
    smallest = min(found.loops[n][1].delay for n in ("roll", "pitch", "yaw"))
    assert found.setpoint_delay == pytest.approx(smallest, rel=0.2)
    time, value = step_response(stack, found, "z", 6.0)
    assert time[-1] == pytest.approx(6.0 - stack.period)
    assert value[-1] == pytest.approx(1.0, abs=0.05)
    assert later.loops["roll"][1].phase < found.loops["roll"][1].phase


def test_the_stabilised_hand_takes_margin_from_the_axes_that_the_arm_pushes(vehicle):
    """The arm of the S-500 moves in the plane of x and z: y and roll stay as they are."""
    free, steered = (
        analyse(stack_model(load_profile(*names), vehicle, arm=(0.6, -1.0)))
        for names in (("s500",), ("s500", "hand"))
    )
    assert free.hand_delay is None and steered.hand_delay > 0.03
    assert steered.stable
    for loop, is_less in (("x", True), ("pitch", True), ("y", False), ("roll", False)):
        before, after = free.loops[loop][1], steered.loops[loop][1]
        assert (after.gain < before.gain - 0.2 or after.phase < before.phase - 3.0) == is_less, loop
    assert steered.loops["x"][1].gain > 6.0  # [dB]
    assert steered.setpoint_delay == pytest.approx(free.setpoint_delay, rel=0.02)


def test_a_torque_setpoint_is_the_law_and_no_loop_of_the_autopilot_answers(vehicle):
    """tau_q = -Mbar (lambda_1 e + lambda_2 e_dot); e_q = roll for a small roll."""
    wrench = load_profile("s500", "wrench_any_law")
    blocks = stack_model(wrench, vehicle).blocks
    law = next(one for one in blocks if "setpoint.roll" in one.outputs)
    motors = next(one for one in blocks if "motor.1" in one.outputs)
    p = wrench.sets["attitude_controller"]
    row = law.d[law.outputs.index("setpoint.roll")]
    by_roll, by_rate = (row[law.inputs.index(f"state.roll{end}")] for end in ("", "_dot"))
    assert by_roll / by_rate == pytest.approx(p.lambda_1[0] / p.lambda_2[0], rel=0.02)
    gyro = [motors.inputs.index(f"true.{name}_dot") for name in ("roll", "pitch", "yaw")]
    rates = next(
        one for one in stack_model(load_profile("s500"), vehicle).blocks if "motor.1" in one.outputs
    )
    assert not motors.d[:, gyro].any() and not len(motors.a)
    assert rates.d[:, gyro].any() and len(rates.a)


@pytest.mark.long  # its step is compiled for it: most of a minute
def test_the_whole_body_law_has_the_margin_of_its_flights():
    """Its hover survives setpoints 20 ms later, with 28 ms it ends early: docs/duel.md."""
    described = load_description("t650")
    base = default_profile("whole_body_l1", described)
    profile = load_profile("fsc_whole_body", vehicle=described, onto=base.sections)
    found = analyse(stack_model(profile, Vehicle.of(described)))
    assert found.stable and 0.020 < found.setpoint_delay < 0.028
    # without what L1 takes off the force, the position has more phase
    still = {
        node: replace(profile.sets[node], l1_cutoff=1e-6)
        for node in ("position_controller", "attitude_controller", "arm_controller")
    }
    calmer = analyse(
        stack_model(replace(profile, sets=profile.sets | still), Vehicle.of(described))
    )
    assert calmer.loops["x"][1].phase > found.loops["x"][1].phase + 5.0


def test_poses_may_be_older_for_a_slower_observer():
    slow, fast = (EstimatorParameters(position_bandwidth=w) for w in (12.0, 30.0))
    assert remaining(slow, 0.012, 0.004, 120.0) < 0.01
    assert remaining(fast, 0.024, 0.004, 120.0) > 1.0
    assert 0.1 < pose_delay(slow, 0.004, 120.0) < 0.25
    assert pose_delay(fast, 0.004, 120.0) < 0.02


@pytest.mark.parametrize("name", ["s500_arm", "hexa_arm", "s500_arm3"])
def test_the_supervisor_has_the_computed_margin(name):
    described = load_description(name)
    profile, vehicle = default_profile("modular", described), Vehicle.of(described)
    cases = [analyse(stack_model(profile, vehicle, payload)) for payload in (0.0, 0.2)]
    computed = min(case.setpoint_delay for case in cases)
    assert verdict(profile.sets["mission"].delay_margin, computed) == "as computed"
    # servos and joint readings may be late, too
    joints = [name for name in described.coordinates if name.startswith("alpha")]
    assert min(case.loops[joint][1].delay for case in cases for joint in joints) > 0.030


def test_a_prediction_gives_roll_and_pitch_phase_and_leaves_yaw(vehicle):
    """It acts on the rate of e_q: a zero at 1 / prediction, 15 degrees at 9 rad/s for 30 ms."""
    profile = default_profile("modular", vehicle.description)
    ahead = replace(profile.sets["attitude_controller"], prediction=0.03)
    predicting = replace(profile, sets=profile.sets | {"attitude_controller": ahead})
    before, after = (
        analyse(stack_model(p, vehicle, late_setpoints=8)) for p in (profile, predicting)
    )
    for name in ("roll", "pitch"):
        assert 10.0 < after.loops[name][1].phase - before.loops[name][1].phase < 20.0
    assert after.loops["yaw"][1].delay == pytest.approx(before.loops["yaw"][1].delay, abs=5e-4)


def test_an_unwritable_folder_is_refused_before_the_flight(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        "uam_lab.experiments.trials.trial.recorded", lambda *_: pytest.fail("flown")
    )
    (tmp_path / "file").touch()
    assert main(["margins", "--out", str(tmp_path / "file" / "out")]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_the_margin_of_the_profile_is_judged():
    assert verdict(0.06, 0.06) == "as computed"
    assert "too large" in verdict(0.07, 0.06)
    assert "smaller than necessary" in verdict(0.03, 0.06)


def test_a_loop_that_acts_on_nothing_has_no_crossing_and_no_warning():
    """A law at its limit answers nothing: L = 0, here from the middle frequency on."""
    omega = np.geomspace(0.1, 100.0, 50)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = margins(omega, np.where(omega < 3.0, 0.5 + 0.0j, 0.0j))
    assert found.delay == found.gain_down == math.inf
    assert found.peak == 1.0


def test_a_posture_beyond_the_joints_ranges_is_refused(tmp_path, capsys):
    assert main(["margins", "--initial", "--arm", "0", "90", "--out", str(tmp_path)]) == 2
    assert "--arm: alpha_2 90 is outside" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("info", "complaint"),
    [
        ({"vehicle": "hexa_arm", "controller": "modular"}, "hexa_arm: give its --vehicle"),
        ({"vehicle": "/pi/s500_arm.yaml", "controller": "asmc1"}, "asmc1: give its --profile"),
    ],
)
def test_the_flight_of_another_law_or_vehicle_is_refused(monkeypatch, capsys, info, complaint):
    flown = SimpleNamespace(info=info)
    monkeypatch.setattr("uam_lab.records.rebuild.series_of", lambda _: flown)
    assert main(["margins", "--flight", "."]) == 2
    assert complaint in capsys.readouterr().err
