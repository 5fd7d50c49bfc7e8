"""The estimator on synthetic motion with known truth, and its filters against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.estimation.pose_clock import no_pose, repeated
from uam_control.maths.rotations import matrix_from_euler, quaternion_from_euler
from uam_control.stages.estimator_stage import EstimatorStage

DT = 0.004


def motion(t):
    """Return position, velocity, acceleration, Euler angles, body rates of a synthetic flight."""
    p = np.array([np.sin(t), 0.5 * np.cos(t), 1.0 + 0.2 * np.sin(2 * t)])
    v = np.array([np.cos(t), -0.5 * np.sin(t), 0.4 * np.cos(2 * t)])
    a = np.array([-np.sin(t), -0.5 * np.cos(t), -0.8 * np.sin(2 * t)])
    euler = np.array([0.1 * np.sin(t), 0.0, 0.0])
    rates = np.array([0.1 * np.cos(t), 0.0, 0.0])
    return p, v, a, euler, rates


def feed(estimator, until, gyro_bias=0.0, force_bias=0.0, latency=3, frozen=np.inf):
    """Pass samples up to `until` [s]: IMU and joints without delay, motion capture `latency` ticks
    late, with a constant pose from `frozen` [s] on."""
    late = []
    for k in range(round(until / DT)):
        t = k * DT
        p, v, a, euler, rates = motion(t)
        force = matrix_from_euler(euler).T @ (a + [0, 0, 9.81])
        if k % 2 == 0:
            seen, _, _, turned, _ = motion(min(t, frozen))
            late.append((k + latency, (t, seen, quaternion_from_euler(turned))))
        while late and late[0][0] <= k:
            estimator.mocap(*late.pop(0)[1])
        estimator.joints(t, np.array([0.3 * np.sin(t), 0.2]), np.array([0.3 * np.cos(t), 0.0]))
        estimator.imu(t, rates + gyro_bias, force + force_bias)
        if estimator.complete:
            state = estimator.update()
    return t, state


@pytest.mark.parametrize("latency", [1, 3, 10, 20, 50])
def test_follows_a_motion_despite_late_motion_capture_and_biases(latency):
    """Without correction of the stored predictions it oscillates from about 40 ms on."""
    estimator = StateEstimator(EstimatorParameters(), 2)
    t, state = feed(estimator, 12.0, gyro_bias=0.01, force_bias=0.1, latency=latency)
    p, v, a, euler, rates = motion(t)
    np.testing.assert_allclose(state[0, :3], p, atol=2e-3)
    np.testing.assert_allclose(state[1, :3], v, atol=1e-2)
    np.testing.assert_allclose(state[2, :3], a, atol=0.08)
    np.testing.assert_allclose(state[0, 3:6], euler, atol=3e-3)
    np.testing.assert_allclose(state[1, 3:6], rates, atol=3e-3)
    np.testing.assert_allclose(state[0, 6:], [0.3 * np.sin(t), 0.2], atol=2e-3)
    np.testing.assert_allclose(state[1, 6:], [0.3 * np.cos(t), 0.0], atol=5e-3)
    np.testing.assert_allclose(state[2, 6:], [-0.3 * np.sin(t), 0.0], atol=3e-2)


@pytest.mark.parametrize("latency", [100, 245])
def test_poses_up_to_a_second_late_keep_the_estimate_near(latency):
    estimator = StateEstimator(EstimatorParameters(), 2)
    t, state = feed(estimator, 30.0, gyro_bias=0.01, force_bias=0.1, latency=latency)
    p, v, *_ = motion(t)
    np.testing.assert_allclose(state[0, :3], p, atol=0.03)
    np.testing.assert_allclose(state[1, :3], v, atol=0.04)


def error_of(imu, mocap, rate, offset=0.0, speed=5.0, acceleration=0.0, seconds=4.0):
    """Return the error of position [m] and velocity [m/s] along a straight line.

    imu, mocap [ticks]: latencies; rate [Hz] and offset [s] of the poses, in no step with the ticks.
    """
    estimator, arrivals = StateEstimator(EstimatorParameters(), 0), []
    force, level = np.array([acceleration, 0.0, 9.81]), np.array([1.0, 0.0, 0.0, 0.0])
    for k in range(round(seconds / DT)):
        arrivals.append((k + imu, 1, k * DT))
    for k in range(round(seconds * rate)):
        stamp = offset + k / rate
        arrivals.append((np.ceil(stamp / DT) + mocap, 0, stamp))
    estimator.joints(0.0, np.zeros(0), np.zeros(0))
    for arrived, is_imu, t in sorted(arrivals):
        if arrived > seconds / DT - 1.0:
            break
        if is_imu:
            estimator.imu(t, np.zeros(3), force)
            state = estimator.update()
            true = speed * t + 0.5 * acceleration * t**2, speed + acceleration * t
        else:
            place = np.array([speed * t + 0.5 * acceleration * t**2, 0.0, 0.0])
            estimator.mocap(t, place, level)
    return np.abs(state[:2, 0] - true)


@pytest.mark.parametrize("rate", [30.0, 120.0, 250.0, 360.0])
@pytest.mark.parametrize("acceleration", [0.0, 4.0])
def test_a_pose_counts_at_its_own_time_whichever_sample_arrives_first(rate, acceleration):
    """5 m/s, pairs of latencies of 0 to 8 ticks, poses between the ticks: 0.1 mm, 1 mm/s."""
    for imu in (0, 1, 4, 8):
        for mocap in (0, 1, 3, 8):
            found = error_of(imu, mocap, rate, 0.0013, acceleration=acceleration)
            assert found[0] < 1e-4 and found[1] < 1e-3, (imu, mocap, *found)


def test_every_pose_of_a_fast_motion_capture_corrects():
    """Of 360 poses in a second each corrects by its share: the error falls as with 120."""
    slow, fast = (error_of(1, 3, rate, speed=0.0, acceleration=1.0, seconds=0.4)[0]
                  for rate in (120.0, 360.0))  # fmt: skip
    assert fast == pytest.approx(slow, rel=0.2)


def test_a_frozen_motion_capture_is_ignored():
    """The estimate continues with the IMU; the repeated pose is 1.4 m away at the end."""
    estimator = StateEstimator(EstimatorParameters(), 2)
    t, state = feed(estimator, 12.0, gyro_bias=0.01, force_bias=0.1, frozen=10.0)
    p, v, *_ = motion(t)
    np.testing.assert_allclose(state[0, :3], p, atol=0.1)
    np.testing.assert_allclose(state[1, :3], v, atol=0.1)


def test_repeats_are_exact():
    newest, pose = no_pose(), (np.ones(3), np.array([1.0, 0.0, 0.0, 0.0]))
    assert [repeated(*pose, newest) for _ in range(3)] == [False, True, True]
    assert not repeated(pose[0] + [0.0, 0.0, 1e-12], pose[1], newest)
    assert not repeated(*pose, newest)


def test_it_is_complete_with_a_sample_of_every_sensor():
    estimator = StateEstimator(EstimatorParameters(), 2)
    assert not estimator.complete
    estimator.imu(0.0, np.zeros(3), np.array([0, 0, 9.81]))
    estimator.joints(0.0, np.zeros(2), np.zeros(2))
    assert not estimator.complete
    estimator.mocap(0.0, np.ones(3), np.array([1.0, 0, 0, 0]))
    np.testing.assert_array_equal(estimator.update()[0, :3], np.ones(3))
    assert estimator.complete


def test_gravity_is_not_an_acceleration():
    estimator = StateEstimator(EstimatorParameters(), 2)
    for k in range(500):
        if k % 2 == 0:
            estimator.mocap(k * DT, np.zeros(3), np.array([1.0, 0, 0, 0]))
        estimator.joints(k * DT, np.zeros(2), np.zeros(2))
        estimator.imu(k * DT, np.zeros(3), np.array([0.0, 0.0, 9.81]))
        state = estimator.update()
    np.testing.assert_allclose(state, 0.0, atol=1e-9)


@pytest.mark.parametrize("stall", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("lost", [0.5, 0.9, 0.97])
@pytest.mark.parametrize("input_", ["imu", "mocap", "joints", "all"])
def test_it_stays_bounded_on_an_overloaded_computer(input_, lost, stall):
    """At rest; samples of an input are lost or come in bursts after stalls of this mean [s]."""
    noise = np.random.default_rng(1)
    stage = EstimatorStage(EstimatorParameters(), 2, DT)
    arrivals = []
    for name, period, delay in (("imu", DT, 1e-3), ("mocap", 1 / 120, 0.012), ("joints", DT, 1e-3)):
        free, bad = 0.0, input_ in (name, "all")
        for k in range(round(20.0 / period)):
            if bad and noise.random() < lost:
                continue
            late = noise.exponential(stall + 1e-9) if bad and noise.random() < 0.05 else 0.0
            free = max(free, k * period + delay + late)
            arrivals.append((free, name, round(1e9 * k * period)))
    for _, name, stamp in sorted(arrivals):
        if name == "mocap":
            seen = quaternion_from_euler(0.002 * noise.normal(size=3))
            stage.mocap(stamp, 0.001 * noise.normal(size=3), seen)
        elif name == "joints":
            stage.joints(stamp, 0.001 * noise.normal(size=2), 0.02 * noise.normal(size=2))
        else:
            force = np.array([0.1, 0.0, 9.81]) + 0.1 * noise.normal(size=3)
            state = stage.imu(stamp, 0.01 * noise.normal(size=3), force)
            if state is not None:
                assert np.abs(state[0, :3]).max() < 1.0
                assert np.abs(state[0, 3:6]).max() < 0.3
                assert np.abs(state[0, 6:]).max() < 0.05
    assert not stage.diverged
