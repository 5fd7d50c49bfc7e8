"""Position setpoints: what is sent, and the stand-in's position control by hand (PX4 v1.16)."""

import math

import numpy as np
import pytest

from uam_control.ages import age_by
from uam_control.setpoints.setpoint_types import position_setpoint
from uam_control.setpoints.targets import FLOWN_MASKS, Desired, PositionTarget, level
from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot.autopilot_estimator import GRAVITY, Estimator
from uam_sim_bridge.autopilot.companion import Companion
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.loops.position_modes import PositionControl, attitude_of, limit_across
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.mavlink.protocol.setpoint_messages import position_target, setpoint_message
from uam_sim_bridge.mavlink.protocol.wire import mavlink2

LEVEL = np.array([1.0, 0, 0, 0])
HOVER = 0.52  # weight / full thrust of the S-500


def target(position=(0, 0, 0), velocity=(0, 0, 0), acceleration=(0, 0, 0), yaw=0.0, mask=0):
    vectors = (np.array(v, dtype=float) for v in (position, velocity, acceleration))
    return PositionTarget(mask, *vectors, yaw, 0.0)


def estimate(position=(0, 0, 0), velocity=(0, 0, 0)):
    return np.array([*LEVEL, *position, *velocity], dtype=float)


def control(**changes):
    parameters = Parameters.of(load_description())
    for name, value in changes.items():
        parameters.set(name, value)
    return PositionControl(parameters)


def test_the_reference_is_sent_in_ned_with_the_yaw_from_north():
    reference = np.array([[1.0, 2.0, 3.0], [0.1, 0.2, 0.3], [4.0, 5.0, 6.0]])
    attitude = level(0.3)
    attitude[1, 2] = 0.05
    sent = position_setpoint(Desired(np.zeros(3), attitude, 0.5, reference))
    np.testing.assert_array_equal(sent.position, [2.0, 1.0, -3.0])
    np.testing.assert_array_equal(sent.velocity, [0.2, 0.1, -0.3])
    np.testing.assert_array_equal(sent.acceleration, [5.0, 4.0, -6.0])
    assert (sent.yaw, sent.yaw_rate) == (pytest.approx(math.pi / 2 - 0.3), -0.05)
    assert math.isnan(sent.thrust) and np.isnan(sent.body_rates).all()


def test_without_a_reference_attitude_and_thrust_are_sent():
    sent = position_setpoint(Desired(np.zeros(3), level(0.0), 0.4))
    assert (sent.type_mask, sent.thrust) == (7, 0.4)


@pytest.mark.parametrize("mask", FLOWN_MASKS)
def test_a_message_carries_it_and_ignored_values_are_zero(mask):
    given = target((1, 2, -3), (0.5, 0, 0), (0, 0.25, 0), 0.5, mask)
    back = position_target(setpoint_message(given, 1.0, 1))
    assert not back.refused() and back.yaw == 0.5
    np.testing.assert_array_equal(back.position, given.position)
    np.testing.assert_array_equal(back.velocity, 0.0 if mask & 0x38 else given.velocity)
    np.testing.assert_array_equal(back.acceleration, 0.0 if mask & 0x1C0 else given.acceleration)


def test_a_setpoint_without_position_or_not_finite_is_refused():
    assert "type_mask 7" in target(mask=7).refused()
    assert target((math.nan, 0, 0)).refused() == "position.x is nan, not finite"
    assert target(yaw=math.inf).refused() == "yaw is inf, not finite"


def test_at_the_setpoint_it_hovers_level():
    setpoint = control().update(target(), estimate(), 0.004)
    np.testing.assert_allclose(
        setpoint, [0.0, 0.0, 0.0, Parameters.of(load_description())["MPC_THR_HOVER"]]
    )


def test_a_position_error_north_pitches_forward_by_hand():
    # 0.5 m: velocity 0.95 * 0.5 = 0.475 m/s, acceleration 1.8 * 0.475 = 0.855 m/s^2
    one = control()
    setpoint = one.update(target((0.5, 0, 0)), estimate(), 0.004)
    pitch = math.atan2(-0.855, GRAVITY)
    assert setpoint[1] == pytest.approx(2.0 * 6.5 * math.sin(pitch / 2.0))
    assert setpoint[0] == pytest.approx(0.0, abs=1e-12)
    hover = one._parameters["MPC_THR_HOVER"]
    assert setpoint[3] == pytest.approx(hover / math.cos(pitch))
    # the integral has moved by 0.4 * 0.475 * 0.004
    np.testing.assert_allclose(one._integral, [0.4 * 0.475 * 0.004, 0.0, 0.0], atol=1e-15)


def test_the_acceleration_is_fed_forward_and_a_yaw_turns_the_tilt():
    # 3 m/s^2 north with the nose to the east: roll to the left
    setpoint = control().update(target(acceleration=(3, 0, 0), yaw=math.pi / 2), estimate(), 0.004)
    wanted = attitude_of(np.array([-3.0, 0.0, GRAVITY]) / math.hypot(3.0, GRAVITY), math.pi / 2)
    roll = -math.atan2(3.0, GRAVITY)
    half = math.pi / 4
    np.testing.assert_allclose(
        wanted,
        [
            math.cos(roll / 2) * math.cos(half),
            math.sin(roll / 2) * math.cos(half),
            math.sin(roll / 2) * math.sin(half),
            math.cos(roll / 2) * math.sin(half),
        ],
    )
    assert setpoint[2] > 0.0  # it turns to the right


def test_an_error_downwards_changes_the_thrust_not_the_tilt():
    # 0.2 m too high: velocity 0.2 m/s down, acceleration 0.8 m/s^2 down
    one = control()
    setpoint = one.update(target((0, 0, 0.2)), estimate(), 0.004)
    hover = one._parameters["MPC_THR_HOVER"]
    assert setpoint[3] == pytest.approx(hover * (1.0 - 0.8 / GRAVITY))
    np.testing.assert_allclose(setpoint[:3], 0.0)


def test_the_derivative_of_the_velocity_damps():
    one = control()
    one.update(target(), estimate(), 0.004)
    slow = one.update(target(velocity=(0.04, 0, 0)), estimate(velocity=(0.04, 0, 0)), 0.004)
    share = 0.004 / (0.004 + 1.0 / (2.0 * math.pi * 5.0))
    damping = 0.2 * share * 0.04 / 0.004
    assert slow[1] == pytest.approx(2.0 * 6.5 * math.sin(math.atan2(damping, GRAVITY) / 2.0))


def test_tilt_and_thrust_are_limited():
    one = control(MPC_TILTMAX_AIR=30.0)
    setpoint = one.update(target(acceleration=(50, 0, 0)), estimate(), 0.004)
    assert setpoint[1] == pytest.approx(-2.0 * 6.5 * math.sin(math.radians(15.0)))
    full = one.update(target((0, 0, -20), acceleration=(0, 0, -30)), estimate(), 0.004)
    assert full[3] <= 1.0
    least = one.update(target(acceleration=(0, 0, 40)), estimate(), 0.004)
    assert least[3] == pytest.approx(0.12, abs=1e-9)


def test_the_vertical_integral_stops_while_the_thrust_saturates():
    one = control()
    for _ in range(200):
        one.update(target((0, 0, -5), acceleration=(0, 0, -20)), estimate(), 0.004)
    assert one._integral[2] == 0.0


@pytest.mark.parametrize(
    ("first", "second", "total"),
    [
        ((1, 0), (1, 0), (2, 0)),
        ((3, 0), (1, 0), (2, 0)),
        ((1, 0), (3, 0), (2, 0)),
        ((0, 0), (0, 5), (0, 2)),
    ],
)
def test_the_correction_has_priority_over_the_feedforward(first, second, total):
    a, b = np.array([*first, 0.0]), np.array([*second, 0.0])
    out = a + b
    limit_across(a, b, 2.0, out)
    np.testing.assert_allclose(out[:2], total)


def armed():
    """Return a stand-in in OFFBOARD, armed, with position setpoints."""
    autopilot = Autopilot()
    companion, down = Companion(autopilot), np.array([0.0, 0.0, -GRAVITY])
    for k in range(500):
        time = 0.004 * k
        if k % 5 == 0:
            autopilot.vision(time, np.zeros(3), LEVEL)
        companion.handle(time, setpoint_message(target((0, 0, -1)), time, 1))
        if k == 300:
            autopilot.command(time, 176, (1.0, 6.0, 0.0))
            autopilot.command(time, 400, (1.0, 0.0))
        autopilot.update(time, np.zeros(3), down)
    return autopilot, companion


def test_the_stand_in_flies_position_setpoints_in_offboard():
    autopilot, companion = armed()
    assert autopilot.commander.armed
    assert autopilot.motors.min() > 0.55  # it climbs to 1 m
    wrong = setpoint_message(target(), 2.0, 1)
    wrong.coordinate_frame = mavlink2.MAV_FRAME_BODY_NED
    companion.handle(2.0, wrong)
    texts = [text for _, text in autopilot.commander.take_texts()]
    assert any("frame 8, local NED expected" in text for text in texts)


def test_without_vision_it_descends_level():
    autopilot, _ = armed()
    climbing = autopilot.motors.mean()
    for k in range(500, 700):
        autopilot.target(0.004 * k, target((0, 0, -1)))
        autopilot.update(0.004 * k, np.zeros(3), np.array([0.0, 0.0, -GRAVITY]))
    assert 0.3 < autopilot.motors.mean() < climbing
    assert np.ptp(autopilot.motors) < 0.01


def test_a_late_pose_is_compared_with_the_estimate_of_its_time():
    def error(age_known):
        filter_, down, speed = Estimator(), np.array([0.0, 0.0, -GRAVITY]), 2.0
        for k in range(1500):
            time = 0.004 * k
            filter_.predict(time, np.zeros(3), down, 0.004)
            if k % 5 == 0:
                seen = np.array([speed * (time - 0.02), 0.0, 0.0])  # 20 ms old
                filter_.vision(time, seen, LEVEL, 0.02 if age_known else 0.0)
        return filter_.estimate[4] - speed * time

    assert error(False) == pytest.approx(-2.0 * 0.02, abs=5e-3)
    assert abs(error(True)) < 2e-3


@pytest.mark.parametrize("late", [0.02, 0.08, 0.18])
def test_late_poses_correct_the_estimate_once(late):
    # at rest, with a velocity that is wrong by 0.3 m/s at first; poses of 125 Hz
    filter_, down = Estimator(), np.array([0.0, 0.0, -GRAVITY])
    errors = []
    for tick in range(1500):
        time = tick * 0.004
        if tick == 100:
            filter_.estimate[7:] = 0.3
        filter_.predict(time, np.zeros(3), down, 0.004)
        if tick % 2 == 0:
            filter_.vision(time, np.zeros(3), LEVEL, late)
        errors.append(np.abs(filter_.estimate[4:]).max())
    assert max(errors) < 0.4
    assert errors[-1] < 0.01


def test_a_pose_that_is_too_late_is_none_for_the_autopilot():
    autopilot = Autopilot()
    taken = [autopilot.vision(9.0, np.zeros(3), LEVEL, age_by(9.0 - age, 9.0)) for age in
             (-0.06, -0.04, 0.03, 0.24, 0.26, 9.0)]  # fmt: skip
    assert taken == [False, True, True, True, False, False]


def test_a_stamp_of_another_clock_gives_no_age():
    assert age_by(1.0, 1.03) == pytest.approx(0.03)
    assert age_by(50.0, 1.0) == age_by(0.0, 50.0) == 0.0


@pytest.mark.parametrize("age", [-0.004, 0.0015, 0.0301, 0.18])
def test_a_pose_of_any_moment_agrees_with_a_steady_motion(age):
    """At 5 m/s the poses lie between samples or ahead of them; they are exact: no error stays."""
    filter_, down = Estimator(), np.array([0.0, 0.0, -GRAVITY])
    for tick in range(1000):
        time = 0.004 * tick
        filter_.predict(time, np.zeros(3), down, 0.004)
        filter_.vision(time, np.array([5.0 * (time - age), 0.0, 0.0]), LEVEL, age)
    np.testing.assert_allclose(filter_.estimate[4:], [5.0 * time, 0, 0, 5.0, 0, 0], atol=0.02)
    assert abs(filter_.estimate[4] - 5.0 * time) < 2.5e-3
