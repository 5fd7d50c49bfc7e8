"""Jumps of an odometry are taken out of its poses, and given back slowly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.estimation.pose_anchor import PoseAnchor
from uam_control.maths.rotations import euler_from_quaternion, quaternion_from_euler

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def yawed(yaw):
    return quaternion_from_euler(np.array([0.0, 0.0, yaw]))


def seen(position, yaw, frame):
    """A pose in a frame (4,): turned by its yaw about the origin, then shifted."""
    x, y, z, turn = frame
    c, s = math.cos(turn), math.sin(turn)
    px, py, pz = position
    return np.array([x + c * px - s * py, y + s * px + c * py, z + pz]), yawed(yaw + turn)


def test_without_a_jump_every_bit_stays():
    anchor, drawn = PoseAnchor(), np.random.default_rng(1)
    for k in range(500):
        time = k / 120.0
        position = np.array([math.sin(time), 0.5 * time, 1.0]) + drawn.normal(0.0, 1e-3, 3)
        quaternion = quaternion_from_euler(drawn.normal(0.0, 2e-3, 3))
        got = anchor(time, position, quaternion)
        np.testing.assert_array_equal(got[0], position)
        np.testing.assert_array_equal(got[1], quaternion)
    assert anchor.jumps == 0


def test_a_jump_by_hand():
    """At rest; a jump by (0.3, 0.4, 0) m, then 0.1 m/s back along it: after 1 s 0.4 m are left."""
    anchor, jump = PoseAnchor(), np.array([0.3, 0.4, 0.0])
    for k in range(100):
        anchor(0.01 * k, np.ones(3) + 1e-9 * k, LEVEL)
    at_once, _ = anchor(1.0, np.ones(3) + jump, LEVEL)
    assert anchor.jumps == 1 and anchor.distance == pytest.approx(0.5)
    np.testing.assert_allclose(at_once, np.ones(3) + 0.002 * jump, atol=1e-6)
    for k in range(1, 100):
        later, _ = anchor(1.0 + 0.01 * k, np.ones(3) + jump + 1e-9 * k, LEVEL)
    np.testing.assert_allclose(later, np.ones(3) + 0.2 * jump, atol=1e-6)
    for k in range(100, 500):
        later, _ = anchor(1.0 + 0.01 * k, np.ones(3) + jump + 1e-9 * k, LEVEL)
    np.testing.assert_allclose(later, np.ones(3) + jump, atol=1e-6)


@settings(max_examples=25)
@given(
    rate=st.sampled_from([30.0, 60.0, 120.0, 360.0]),
    phase=st.floats(0.0, 2.0 * math.pi),
    frame=st.tuples(*[st.floats(-0.28, 0.28)] * 3, st.floats(-0.3, 0.3)),
)
def test_no_jump_up_to_half_a_metre_moves_the_poses(rate, phase, frame):
    """On a circle of 1 m at 1 m/s, at any place of it: from pose to pose they go on with the
    vehicle, and never run from it faster than what is given back."""
    anchor, before, jump = PoseAnchor(), (np.zeros(3), 0.0), np.linalg.norm(frame[:3])
    began = 0
    for k in range(round(3.0 * rate)):
        time = k / rate
        angle = time + phase
        position, now = np.array([math.cos(angle), math.sin(angle), 1.0]), time >= 1.5
        place, quaternion = seen(position, angle, frame if now else np.zeros(4))
        got, turned = anchor(time, place, quaternion)
        offset = got - position
        yaw = euler_from_quaternion(turned)[2] - angle
        yaw -= 2.0 * math.pi * round(yaw / (2.0 * math.pi))
        if time > 1.0:
            # the vehicle's turn makes part of the poses' way about the origin
            assert np.linalg.norm(offset - before[0]) < (0.1 + abs(frame[3])) / rate + 0.006
            assert abs(yaw - before[1]) < 0.1 / rate + 0.003
        before = offset, yaw
        began = anchor.jumps if time < 1.5 else began
    assert anchor.jumps - began == 1 or (jump < 0.1 and abs(frame[3]) < 0.05)


def test_a_speed_that_it_did_not_know_is_no_row_of_jumps():
    anchor = PoseAnchor()
    for k in range(60):
        got, _ = anchor(k / 30.0, np.array([2.0 * k / 30.0, 0.0, 0.0]), LEVEL)
    assert anchor.jumps < 8
    assert abs(got[0] - 2.0 * k / 30.0) < 0.1


def test_a_single_outlier_leaves_nothing():
    anchor = PoseAnchor()
    for k in range(200):
        out = 0.4 if k == 100 else 0.0
        got, _ = anchor(0.01 * k, np.array([1.0 + out, 1e-9 * k, 0.0]), LEVEL)
        assert abs(got[0] - 1.0) < 0.008
    assert anchor.jumps == 2


def test_a_frozen_odometry_stays_frozen():
    """Else what is given back would hide that the poses repeat."""
    anchor = PoseAnchor()
    for k in range(100):
        anchor(0.01 * k, np.array([1e-6 * k, 0.0, 0.0]), LEVEL)
    place = np.array([0.5, 0.0, 0.0])
    first = [part.copy() for part in anchor(1.0, place, LEVEL)]
    second = anchor(1.01, place, LEVEL)
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])


@pytest.mark.parametrize("tick", range(6))
def test_a_jump_at_any_tick_does_not_move_the_estimate(tick):
    """The vehicle stands; half a metre and 17 degrees. The estimate follows what is given back."""
    estimator, anchor = StateEstimator(EstimatorParameters(), 0), PoseAnchor()
    drawn = np.random.default_rng(tick)
    for k in range(1000):
        if k % 2 == 0:
            frame = (0.3, -0.4, 0.0, 0.3) if k >= 500 + tick else np.zeros(4)
            place, quaternion = seen(np.array([0.5, 0.5, 1.0]), 0.0, frame)
            place = place + drawn.normal(0.0, 2e-4, 3)
            estimator.mocap(0.004 * k, *anchor(0.004 * k, place, quaternion))
        estimator.imu(0.004 * k, np.zeros(3), np.array([0.0, 0.0, 9.81]))
        state = estimator.update()
        if k > 250:
            assert np.linalg.norm(state[1, :3]) < 0.15
            assert np.abs(state[0, 3:5]).max() < 0.01  # upright
    assert anchor.jumps == 1 and estimator.refused_poses == 0
