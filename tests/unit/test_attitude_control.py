"""The stand-in's attitude loop against hand-worked values; PX4's structure."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.maths.rotations import quaternion_from_euler, quaternion_multiply
from uam_sim_bridge.autopilot.loops.attitude_control import attitude_gains, attitude_rates
from uam_sim_bridge.autopilot.params import DEFINITIONS, Parameters

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
FAST = dict.fromkeys(("MC_ROLLRATE_MAX", "MC_PITCHRATE_MAX", "MC_YAWRATE_MAX"), 1800.0)
angles = st.floats(-1.2, 1.2)


def rates(attitude, desired, yaw_rate=0.0, **changes):
    """Body rates of the loop; attitudes as roll, pitch, yaw [rad] or quaternions."""
    out = np.zeros(4)
    q, q_d = (
        quaternion_from_euler(np.array(a, float)) if len(a) == 3 else np.array(a)
        for a in (attitude, desired)
    )
    attitude_rates(q, q_d, yaw_rate, attitude_gains(Parameters({**FAST, **changes})), out)
    assert out[3] == 0.0
    return out[:3]


def test_defaults_and_ranges_are_px4s():
    found = {n: (d.default, d.low, d.high) for n, d in DEFINITIONS.items()}
    assert found["MC_ROLL_P"] == found["MC_PITCH_P"] == (6.5, 0.0, 12.0)
    assert found["MC_YAW_P"] == (2.8, 0.0, 5.0) and found["MC_YAW_WEIGHT"] == (0.4, 0.0, 1.0)
    assert found["MC_ROLLRATE_MAX"] == found["MC_PITCHRATE_MAX"] == (220.0, 0.0, 1800.0)
    assert found["MC_YAWRATE_MAX"] == (200.0, 0.0, 1800.0)


def test_roll_alone_by_hand():
    # 2 sin(0.2/2) P = 2 * 0.0998334 * 6.5 = 1.297834
    assert rates((0, 0, 0), (0.2, 0, 0)) == pytest.approx([1.297834, 0.0, 0.0], abs=1e-6)


def test_yaw_alone_has_the_yaw_gain_whatever_the_weight():
    # 2 sin(w 0.1/2) P/w = 0.2799883 for w = 0.4, 0.2798834 for w = 1: both 2.8 * 0.1 for small yaw
    assert rates((0, 0, 0), (0, 0, 0.1))[2] == pytest.approx(0.279981, abs=1e-5)
    assert rates((0, 0, 0), (0, 0, 0.1), MC_YAW_WEIGHT=1.0)[2] == pytest.approx(0.279883, abs=1e-6)


def test_a_weight_of_zero_leaves_yaw_alone():
    assert rates((0, 0, 0), (0, 0, 1.0), MC_YAW_WEIGHT=0.0) == pytest.approx([0, 0, 0], abs=1e-12)


def test_roll_and_pitch_come_first_where_yaw_is_far_off():
    """The vehicle's z axis takes the shortest way: with yaw 90 deg off, a desired roll of q_d is a
    pitch of the body as it stands."""
    # q_d: yaw 90 deg, then roll 0.2: z axis towards sin(0.2) in world +x: pitch up by 0.2
    found = rates((0, 0, 0), (0.2, 0, math.pi / 2), MC_YAW_WEIGHT=0.0)
    assert found == pytest.approx([0.0, 1.297834, 0.0], abs=1e-6)


def test_the_yaw_rate_turns_about_the_worlds_axis():
    # pitched by 0.3, the world's down axis in the body is (-sin 0.3, 0, cos 0.3)
    found = rates((0, 0.3, 0), (0, 0.3, 0), yaw_rate=0.5)
    assert found == pytest.approx([-0.5 * math.sin(0.3), 0.0, 0.5 * math.cos(0.3)], abs=1e-12)


def test_rates_are_limited_per_axis():
    limits = {"MC_ROLLRATE_MAX": 90.0, "MC_PITCHRATE_MAX": 60.0, "MC_YAWRATE_MAX": 45.0}
    for axis, limit in enumerate(limits.values()):
        for sign in (1.0, -1.0):
            desired = np.zeros(3)
            desired[axis] = sign * 1.4
            expected = np.zeros(3)
            expected[axis] = sign * math.radians(limit)
            assert rates((0, 0, 0), desired, **limits) == pytest.approx(expected, abs=1e-12)


def test_upside_down_is_the_full_rotation_to_the_desired_attitude():
    """Where z must turn by 180 deg there is no shortest way."""
    found = rates((0, 0, 0), (math.pi, 0, 0))
    assert found == pytest.approx([2.0 * 6.5, 0.0, 0.0], abs=1e-4)


@given(angles, angles, angles)
def test_no_error_no_rates_and_the_sign_of_the_quaternion_means_nothing(roll, pitch, yaw):
    q = quaternion_from_euler(np.array([roll, pitch, yaw]))
    assert rates(q, q) == pytest.approx([0, 0, 0], abs=1e-6)
    desired = quaternion_from_euler(np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(rates(-q, desired), rates(q, desired), atol=1e-9)
    np.testing.assert_allclose(rates(q, -desired), rates(q, desired), atol=1e-9)


@given(angles, angles, angles, angles, angles, st.floats(-math.pi, math.pi))
def test_the_heading_of_the_world_means_nothing(a, b, c, d, e, turn):
    q = quaternion_from_euler(np.array([a, b, c]))
    desired = quaternion_from_euler(np.array([d, e, c + 0.5]))
    world = quaternion_from_euler(np.array([0.0, 0.0, turn]))
    found = rates(quaternion_multiply(world, q), quaternion_multiply(world, desired))
    np.testing.assert_allclose(found, rates(q, desired), atol=1e-7)


@given(angles, angles, angles, angles)
def test_with_full_weight_it_is_the_plain_quaternion_law(a, b, c, d):
    """rates = P 2 Im(q^-1 q_d) where yaw has its full share and all gains are one."""
    q, desired = (
        quaternion_from_euler(np.array([a, b, 0.0])),
        quaternion_from_euler(np.array([c, d, 0.4])),
    )
    error = quaternion_multiply(q * [1, -1, -1, -1], desired)
    plain = 2.0 * np.sign(error[0]) * error[1:]
    ones = {"MC_ROLL_P": 1.0, "MC_PITCH_P": 1.0, "MC_YAW_P": 1.0, "MC_YAW_WEIGHT": 1.0}
    np.testing.assert_allclose(rates(q, desired, **ones), plain, atol=1e-6)
