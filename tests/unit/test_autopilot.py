"""The autopilot object on a rigid quadrotor: arming rules, hover, rate steps, failsafe descent."""

import math

import numpy as np
import pytest
from quadrotor import INERTIA, MASS, Quadrotor

from uam_control.frames import swap_body, swap_quaternion, swap_world
from uam_control.maths.rotations import quaternion_multiply
from uam_control.offboard.firmware import FIRMWARES, PX4
from uam_control.offboard.modes import FORCE, MavCmd, MavResult, Mode
from uam_control.setpoints.rate_thrust_map import RateThrustMap, RateThrustParameters
from uam_control.setpoints.targets import AttitudeTarget, WrenchTarget
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot.autopilot_estimator import POSITION
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.loops.position_modes import PositionModes
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.mavlink.protocol.setpoint_messages import setpoint_message, wrench_target

OFFBOARD = (1.0, 6.0, 0.0)
PX4_MODES = FIRMWARES[PX4]
HOVER = MASS * 9.81 / (4 * 10.34)


class Bench:
    """Quadrotor and autopilot in one loop, with vision at 125 Hz."""

    def __init__(self, height=0.0):
        self.autopilot = Autopilot(Parameters.of(load_description()))
        self.body = Quadrotor(height=height)
        self.vision = True
        self.vision_tilt = np.array([1.0, 0.0, 0.0, 0.0])
        self.accelerometer_bias = np.zeros(3)  # m/s^2, FLU
        self.ticks = 0

    @property
    def time(self):
        return self.body.time

    def tick(self, setpoint=None):
        """One 4 ms tick; setpoint: (rates FLU (3,), thrust) or None."""
        body, autopilot = self.body, self.autopilot
        self.ticks += 1
        if self.vision and self.ticks % 2:
            attitude = quaternion_multiply(body.quaternion, self.vision_tilt)
            autopilot.vision(body.time, swap_world(body.position), swap_quaternion(attitude))
        if setpoint is not None:
            rates = swap_body(np.array(setpoint[0], float))
            assert not autopilot.target(body.time, AttitudeTarget.of_rates(rates, setpoint[1]))
        accel = body.accel + self.accelerometer_bias
        motors = autopilot.update(body.time, swap_body(body.gyro), swap_body(accel))
        body.step(motors)
        return motors

    def run(self, seconds, setpoint=None):
        for _ in range(round(seconds / 0.004)):
            self.tick(setpoint)

    def command(self, command, *parameters):
        return self.autopilot.command(self.time, command, (*parameters, *[0.0] * 7)[:7])

    def texts(self):
        return " / ".join(text for _, text in self.autopilot.commander.take_texts())

    def fly(self):
        """Arm on the ground or in the air, OFFBOARD, idle setpoints."""
        self.run(1.0, ((0, 0, 0), 0.0))
        assert self.command(MavCmd.DO_SET_MODE, *OFFBOARD) == MavResult.ACCEPTED
        assert self.command(MavCmd.ARM_DISARM, 1.0) == MavResult.ACCEPTED
        return self


def airborne():
    """An armed bench that hovers 20 m up."""
    bench = Bench().fly()
    bench.body.position[2] = 20.0
    bench.body.hover()
    bench.run(2.0, ((0, 0, 0), HOVER))  # until the estimator has forgotten the jump
    return bench


def test_offboard_needs_a_stream():
    bench = Bench()
    bench.run(0.5)
    assert bench.command(MavCmd.DO_SET_MODE, *OFFBOARD) == MavResult.TEMPORARILY_REJECTED
    assert "no offboard signal" in bench.texts()
    for _ in range(3):  # 1 Hz is too slow
        bench.tick(((0, 0, 0), 0.0))
        bench.run(1.0)
    assert bench.command(MavCmd.DO_SET_MODE, *OFFBOARD) == MavResult.TEMPORARILY_REJECTED
    bench.run(0.6, ((0, 0, 0), 0.0))
    assert bench.command(MavCmd.DO_SET_MODE, *OFFBOARD) == MavResult.ACCEPTED
    assert bench.autopilot.status.mode is Mode.OFFBOARD


def test_arming_refused_without_stream():
    bench = Bench()
    bench.run(1.0, ((0, 0, 0), 0.0))
    bench.command(MavCmd.DO_SET_MODE, *OFFBOARD)
    bench.run(2.0)
    assert bench.command(MavCmd.ARM_DISARM, 1.0) == MavResult.TEMPORARILY_REJECTED
    assert "no offboard signal" in bench.texts()


def test_arming_refused_without_vision():
    bench = Bench()
    bench.vision = False
    bench.run(1.0, ((0, 0, 0), 0.0))
    bench.command(MavCmd.DO_SET_MODE, *OFFBOARD)
    assert bench.command(MavCmd.ARM_DISARM, 1.0) == MavResult.TEMPORARILY_REJECTED
    assert "vision" in bench.texts()
    bench.vision = True
    bench.run(0.2, ((0, 0, 0), 0.0))
    assert bench.command(MavCmd.ARM_DISARM, 1.0) == MavResult.ACCEPTED


def test_arming_refused_when_vision_and_gravity_disagree():
    bench = Bench()
    bench.vision_tilt = np.array([math.cos(0.3), math.sin(0.3), 0.0, 0.0])  # 34 deg of roll
    bench.run(1.0, ((0, 0, 0), 0.0))
    bench.command(MavCmd.DO_SET_MODE, *OFFBOARD)
    assert bench.command(MavCmd.ARM_DISARM, 1.0) == MavResult.TEMPORARILY_REJECTED
    assert "tilt differs" in bench.texts()


def test_arming_refused_outside_offboard():
    bench = Bench()
    bench.run(1.0, ((0, 0, 0), 0.0))
    assert bench.command(MavCmd.ARM_DISARM, 1.0) == MavResult.TEMPORARILY_REJECTED
    assert "Offboard" in bench.texts()


@pytest.mark.parametrize(
    ("command", "parameters", "result"),
    [
        (MavCmd.ARM_DISARM, (0.5,), MavResult.DENIED),
        (MavCmd.ARM_DISARM, (math.nan,), MavResult.DENIED),
        (MavCmd.DO_SET_MODE, (1.0, 3.0, 0.0), MavResult.DENIED),
        (MavCmd.DO_SET_MODE, (1.0, 99.0, 0.0), MavResult.DENIED),
        (MavCmd.DO_SET_MODE, (0.0, 6.0, 0.0), MavResult.DENIED),
        (MavCmd.DO_SET_MODE, (1.0, math.nan, 0.0), MavResult.DENIED),
        (MavCmd.DO_SET_MODE, (math.inf, 6.0, 0.0), MavResult.DENIED),
        (12345, (), MavResult.UNSUPPORTED),
    ],
)
def test_odd_commands(command, parameters, result):
    assert Bench().command(command, *parameters) == result


def test_motors_stand_still_while_disarmed():
    bench = Bench()
    bench.run(1.0, ((1.0, 1.0, 1.0), 0.9))
    assert np.all(bench.tick(((1.0, 1.0, 1.0), 0.9)) == 0.0)


def test_hover_thrust_carries_the_weight():
    bench = airborne()
    _, thrust = RateThrustMap().map(np.array([0.0, 0.0, MASS * 9.81]), *np.zeros((3, 3)))
    before = bench.body.velocity[2]
    bench.run(2.0, ((0, 0, 0), thrust))
    assert bench.body.thrusts.sum() == pytest.approx(MASS * 9.81, rel=1e-3)
    assert bench.body.velocity[2] == pytest.approx(before, abs=0.02)


@pytest.mark.parametrize(("axis", "size"), [(0, 1.0), (1, 1.0), (2, 0.5)])
def test_rate_steps_are_followed(axis, size):
    bench = airborne()
    desired = np.zeros(3)
    desired[axis] = size
    rates = []
    for _ in range(125 if axis < 2 else 500):
        bench.tick((desired, HOVER))
        rates.append(bench.body.gyro.copy())
    rates = np.array(rates)
    half = np.argmax(rates[:, axis] > 0.5 * size) * 0.004
    assert half < (0.12 if axis < 2 else 0.5)
    assert rates[:, axis].max() < 1.5 * size
    assert rates[-25:, axis].mean() == pytest.approx(size, rel=0.15)
    others = np.delete(rates, axis, axis=1)
    assert np.abs(others).max() < 0.1 * size


def test_a_torque_through_the_map_is_the_torque_that_acts():
    """tau_q → body rates → P path → motors: the first reaction equals tau_q (D and I aside)."""
    bench = airborne()
    tau_q = np.array([0.2, -0.15, 0.0])
    rates, thrust = RateThrustMap().map(
        np.array([0.0, 0.0, MASS * 9.81]), tau_q, np.zeros(3), bench.body.gyro
    )
    bench.autopilot.set_parameter("MC_ROLLRATE_I", 0.0)
    motors = bench.autopilot
    bench.tick((rates, thrust))
    u = motors.motors
    newtons = 10.34 * (0.3 * u * u + 0.7 * u)
    arm = 0.171
    roll = arm * (-newtons[0] + newtons[1] + newtons[2] - newtons[3])
    pitch = arm * (-newtons[0] + newtons[1] - newtons[2] + newtons[3])
    assert [roll, pitch] == pytest.approx([0.2, -0.15], abs=0.01)
    assert newtons.sum() == pytest.approx(MASS * 9.81, rel=1e-6)


def test_setpoints_that_are_not_finite_are_refused():
    bench = airborne()
    before = bench.autopilot._setpoint.copy()
    for bad in (math.nan, math.inf):
        for field, target in {
            "rates.x": AttitudeTarget.of_rates(np.array([bad, 0.0, 0.0]), 0.5),
            "thrust": AttitudeTarget.of_rates(np.zeros(3), bad),
            "quaternion.y": AttitudeTarget.of_attitude(np.array([1.0, 0.0, bad, 0.0]), 0.5),
            "torque.z": WrenchTarget(np.array([0.0, 0.0, bad]), 0.5),
        }.items():
            refused = bench.autopilot.target(bench.time, target)
            assert refused == f"{field} is {bad}, not finite"
    assert np.all(bench.autopilot._setpoint == before)
    bench.autopilot.target(bench.time, AttitudeTarget.of_rates(np.zeros(3), 7.0))
    assert bench.autopilot._setpoint[3] == 1.0


def test_loss_of_the_stream_descends_level_and_disarms():
    bench = airborne()
    bench.body.position[2] = 3.0
    bench.run(0.5, ((0.5, 0.0, 0.0), HOVER))  # some tilt left
    bench.run(0.4)
    assert bench.autopilot.status.mode is Mode.OFFBOARD
    bench.run(0.2)
    status = bench.autopilot.status
    assert status.mode is Mode.LAND and status.failsafe and status.armed
    assert "Failsafe" in bench.texts()
    speeds = []
    for _ in range(3000):
        bench.tick()
        speeds.append(bench.body.velocity[2])
        if not bench.autopilot.status.armed:
            break
    assert not bench.autopilot.status.armed
    assert bench.body.position[2] == 0.0
    assert "Disarmed by landing" in bench.texts()
    assert min(speeds) > -1.6
    assert min(speeds[250:]) > -1.0


@pytest.mark.parametrize("mode", [Mode.LAND, Mode.RETURN])
@pytest.mark.parametrize("strength", [0.85, 1.0])
def test_rotors_weaker_than_told_do_not_make_a_landing_hard(mode, strength):
    bench = airborne()
    bench.body.mass /= strength  # as weaker rotors
    bench.run(4.0, ((0, 0, 0), HOVER / strength))
    assert abs(bench.body.velocity[2]) < 0.3
    bench.autopilot._position_modes.home[:] = swap_world(bench.body.position)
    assert bench.command(MavCmd.DO_SET_MODE, *PX4_MODES.mode_request(mode)) == MavResult.ACCEPTED
    sinks = []
    for _ in range(1000):
        bench.tick()
        sinks.append(-bench.body.velocity[2])
    # MPC_LAND_SPEED; P 4, I 2: poles at 0.6 and 3.4 1/s, zero at 0.5 1/s, 7 % of overshoot
    assert max(sinks) < 0.7 * 1.1 and sinks[-1] == pytest.approx(0.7, abs=0.02)


def test_descent_without_vision_stays_level():
    bench = airborne()
    bench.vision = False
    bench.run(1.1)
    bench.run(3.0)
    tilt = 2 * math.acos(min(1.0, abs(bench.body.quaternion[0])))
    assert tilt < math.radians(5.0)
    assert -2.5 < bench.body.velocity[2] < 0.0


@pytest.mark.parametrize("vision", [True, False])
def test_a_fast_vehicle_is_braked_in_the_descent(vision):
    """On the ground it would turn over."""
    bench = airborne()
    bench.body.position[2] = 5.0
    bench.run(1.0, ((0.5, 0.0, 0.0), HOVER / 0.95))
    bench.run(0.8, ((0.0, 0.0, 0.0), HOVER / 0.9))
    assert math.hypot(*bench.body.velocity[:2]) > 3.0
    bench.vision = vision
    bench.run(3.5)
    assert math.hypot(*bench.body.velocity[:2]) < 1.3 and bench.body.position[2] > 0.0


def test_offboard_returns_only_on_request():
    bench = airborne()
    bench.run(1.5)
    bench.run(1.0, ((0, 0, 0), HOVER))
    assert bench.autopilot.status.mode is Mode.LAND
    assert bench.command(MavCmd.DO_SET_MODE, *OFFBOARD) == MavResult.ACCEPTED
    bench.run(0.1, ((0, 0, 0), HOVER))
    assert bench.autopilot.status.mode is Mode.OFFBOARD and bench.autopilot.status.armed


def test_disarming_in_flight_needs_force():
    bench = airborne()
    assert bench.command(MavCmd.ARM_DISARM, 0.0) == MavResult.TEMPORARILY_REJECTED
    assert "not landed" in bench.texts()
    assert bench.command(MavCmd.ARM_DISARM, 0.0, FORCE) == MavResult.ACCEPTED
    assert np.all(bench.tick(((0, 0, 0), HOVER)) == 0.0)


def test_forced_arming_skips_the_estimator():
    bench = Bench()
    bench.vision = False
    bench.run(1.0, ((0, 0, 0), 0.0))
    bench.command(MavCmd.DO_SET_MODE, *OFFBOARD)
    assert bench.command(MavCmd.ARM_DISARM, 1.0, FORCE) == MavResult.ACCEPTED


def test_auto_disarm_without_take_off():
    bench = Bench().fly()
    bench.run(9.5, ((0, 0, 0), 0.0))
    assert bench.autopilot.status.armed
    bench.run(1.0, ((0, 0, 0), 0.0))
    assert not bench.autopilot.status.armed


def test_integral_is_frozen_on_the_ground_and_cleared_when_disarmed():
    bench = Bench().fly()
    bench.run(1.0, ((0.3, 0.0, 0.0), 0.05))
    assert np.all(bench.autopilot._memory[4] == 0.0)
    bench.run(1.0, ((0.3, 0.0, 0.0), 0.4))  # pushes, does not lift
    assert bench.autopilot._memory[4, 0] > 0.02
    bench.command(MavCmd.ARM_DISARM, 0.0, FORCE)
    bench.tick()
    assert np.all(bench.autopilot._memory[4] == 0.0)


def test_parameters_are_checked_and_take_effect():
    autopilot = Autopilot()
    for name, value in (
        ("MC_ROLLRATE_P", -1.0),
        ("NOT_THERE", 1.0),
        ("THR_MDL_FAC", math.nan),
        ("MAV_SYS_ID", 1.5),
        ("COM_OF_LOSS_T", True),
    ):
        with pytest.raises(ParameterError, match=name):
            autopilot.set_parameter(name, value)
    autopilot.set_parameter("MC_ROLLRATE_K", 2.0)
    assert autopilot._loop.gains[0, 0] == pytest.approx(0.3)
    with pytest.raises(ValueError, match="geometry"):  # all rotors turning one way: no yaw
        for i in range(4):
            autopilot.set_parameter(f"CA_ROTOR{i}_KM", 0.01)


def test_parameter_files(tmp_path):
    bad = tmp_path / "bad.yaml"
    with pytest.raises(ParameterError, match="No such file"):
        Parameters.of(load_description(), bad)
    for text, message in (
        ("[1, 2]", "NAME: value"),
        ("MC_ROLLRATE_P: x", "not a number"),
        ("A: [", "not valid YAML"),
        ("FOO: 1", "unknown"),
        ("CA_ROTOR1_PX: 0.2", "0.2, but s500_arm.yaml makes it -0.171"),
    ):
        bad.write_text(text)
        with pytest.raises(ParameterError, match=message) as error:
            Parameters.of(load_description(), bad)
        assert "\n" not in str(error.value) and "bad.yaml" in str(error.value)


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.RETURN])
def test_on_the_ground_hold_and_return_idle_and_disarm(mode):
    bench = Bench().fly()
    assert (
        bench.command(MavCmd.DO_SET_MODE, *FIRMWARES["px4"].mode_request(mode))
        == MavResult.ACCEPTED
    )
    bench.run(9.0)
    assert bench.autopilot.status.armed and np.all(bench.autopilot.motors < 0.1)
    bench.run(2.0)
    assert not bench.autopilot.status.armed and bench.body.position[2] == pytest.approx(0.0)


def test_in_position_the_stick_takes_off():
    bench = Bench().fly()
    bench.autopilot.manual(bench.time, (0.0, 0.0, 0.0, 0.0))
    position = FIRMWARES["px4"].mode_request(Mode.POSITION)
    assert bench.command(MavCmd.DO_SET_MODE, *position) == MavResult.ACCEPTED
    for stick, rises in ((0.0, False), (0.5, True)):
        for _ in range(8):
            bench.autopilot.manual(bench.time, (0.0, 0.0, stick, 0.0))
            bench.run(0.25)
        assert (bench.body.position[2] > 0.2) == rises


@pytest.mark.parametrize(
    ("bias", "seconds", "wait"),
    [(-0.15, 0.3, 0.0), (0.15, 1.0, 0.0), (0.15, 0.3, 6.0), (-0.15, 1.0, 6.0)],
)
def test_a_vehicle_without_vision_comes_down_once_and_is_disarmed(bias, seconds, wait):
    # the accelerometer's bias is known from the ground; after 5 s the sink speed is not valid
    bench = Bench()
    bench.accelerometer_bias[2] = bias
    bench.fly()
    bench.run(0.2, ((0, 0, 0), 1.1 * HOVER))
    bench.run(seconds, ((0, 0, 0), 1.02 * HOVER))
    bench.vision = False
    bench.run(wait, ((0, 0, 0), HOVER))
    heights = []
    for _ in range(round(25.0 / 0.004)):
        bench.tick()
        heights.append(bench.body.position[2])
        if not bench.autopilot.status.armed:
            break
    assert not bench.autopilot.status.armed and "Disarmed by landing" in bench.texts()
    down = next(i for i, height in enumerate(heights) if height <= 0.0)
    assert max(heights[down:]) < 0.01 and max(heights) < heights[0] + 0.5


def test_a_wrench_drives_the_motors_without_a_rate_loop():
    """A torque of 0.1 accelerates the roll until another setpoint comes; rates stop it again."""
    bench = airborne()
    scale = RateThrustParameters.of(load_description()).torque_scale(load_description())
    target = WrenchTarget(np.array([0.02, 0.0, 0.0]), HOVER)
    rolls = []
    for _ in range(25):
        message = setpoint_message(target, bench.time, 1)
        assert not bench.autopilot.target(bench.time, wrench_target(message))
        bench.tick()
        rolls.append(bench.body.gyro[0])
    expected = 0.02 * scale[0] / INERTIA[0]
    assert np.diff(rolls[12:]).mean() / 0.004 == pytest.approx(expected, rel=0.1)
    bench.run(0.5, ((0, 0, 0), HOVER))
    assert abs(bench.body.gyro[0]) < 0.2


def test_return_that_has_begun_to_land_goes_on_beside_its_home():
    modes, place = PositionModes(Parameters.of(load_description())), np.zeros(10)
    place[0] = 1.0
    sinks = []
    for mode, north in [(Mode.RETURN, 0.5), (Mode.RETURN, 0.2), (Mode.RETURN, 0.5)] + [
        (Mode.POSITION, 0.2),
        (Mode.RETURN, 0.5),
    ]:
        place[POSITION] = north, 0.0, -1.0
        modes.fly(mode, place, 0.004, 0.5)
        sinks.append(modes.sinking)
    assert sinks == [False, True, True, False, False]
