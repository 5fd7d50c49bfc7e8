"""What the estimator makes of single samples, against hand-worked numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.estimation.estimator import arrays_of, assemble
from uam_control.estimation.pose_filter import parts_of
from uam_control.stages.estimator_stage import PoseAge, age_at

LEVEL, WEIGHT, NOTHING = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 9.81]), np.zeros(3)
HALF = math.sqrt(0.5)
ONE = 0.5 / math.pi  # [Hz] corner of a filter whose omega is 1 rad/s


def gathered(period, joints=2):
    """Assemble a state from numbers that are all different; return it and the filters."""
    cutoffs = {"angular_acceleration_cutoff": 2.0 * ONE, "acceleration_cutoff": ONE}
    arrays = StateEstimator(EstimatorParameters(**cutoffs), joints).arrays
    motion, _, _ = parts_of(arrays.pose.memory)
    state, angles, _, rates_filter, filtered = arrays_of(arrays.memory)
    state[:], filtered[:] = 77.0, (10.0, 20.0, 30.0)
    angles[:] = np.arange(1.0, joints + 1.0), np.arange(11.0, joints + 11.0)
    motion.position[:], motion.velocity[:] = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    motion.quaternion[:], motion.rates[:] = (HALF, 0.0, 0.0, HALF), (0.5, -1.0, 2.0)
    motion.acceleration[:] = 12.0, 24.0, 36.0
    arrays.numbers["period"] = period
    assemble(arrays)
    return state, rates_filter, filtered


@pytest.mark.parametrize("joints", [1, 2, 3])
def test_a_state_is_gathered(joints):
    state, _, filtered = gathered(0.0, joints)
    np.testing.assert_allclose(state[0, :6], [1.0, 2.0, 3.0, 0.0, 0.0, math.pi / 2.0], atol=1e-15)
    np.testing.assert_array_equal(state[1, :6], [4.0, 5.0, 6.0, 0.5, -1.0, 2.0])
    np.testing.assert_array_equal(state[0, 6:], np.arange(1.0, joints + 1.0))
    np.testing.assert_array_equal(state[1, 6:], np.arange(11.0, joints + 11.0))
    # no time has passed: the accelerations stay as they were; those of the joints are not its own
    np.testing.assert_array_equal(state[2, :3], [10.0, 20.0, 30.0])
    np.testing.assert_array_equal(state[2, 3:], 77.0)
    np.testing.assert_array_equal(filtered, [10.0, 20.0, 30.0])


def test_accelerations_are_filtered_over_the_period():
    state, rates_filter, filtered = gathered(math.log(2.0))
    np.testing.assert_allclose(filtered, [11.0, 22.0, 33.0])  # half of the way
    np.testing.assert_array_equal(state[2, :3], filtered)
    # omega = 2: x from 0 to the rate: x' = omega^2 dt e^(-omega dt) rate = 4 ln 2 / 4 rate
    np.testing.assert_allclose(state[2, 3:6], math.log(2.0) * np.array([0.5, -1.0, 2.0]))
    np.testing.assert_array_equal(rates_filter[1], state[2, 3:6])
    np.testing.assert_array_equal(state[2, 6:], 77.0)


def started(**parameters) -> StateEstimator:
    """An estimator that was shown a vehicle at rest at 0 s."""
    estimator = StateEstimator(EstimatorParameters(**parameters), 2)
    estimator.imu(0.0, NOTHING, WEIGHT)
    estimator.mocap(0.0, np.array([1.0, 2.0, 3.0]), LEVEL)
    estimator.joints(0.0, np.array([0.3, -0.2]), np.array([1.0, -2.0]))
    estimator.update()
    return estimator


def test_it_starts_at_the_first_samples():
    state = started().update()
    assert state.shape == (3, 8)
    np.testing.assert_array_equal(state[0], [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.3, -0.2])
    np.testing.assert_array_equal(state[1], [0.0] * 6 + [1.0, -2.0])
    np.testing.assert_array_equal(state[2], 0.0)


@pytest.mark.parametrize(("stamp", "counted"), [(0.04, 0.04), (0.2, 0.05), (-0.1, 0.0), (0.0, 0.0)])
def test_imu_samples_count_for_the_time_since_the_last_but_50_ms_at_most(stamp, counted):
    estimator = started()
    estimator.imu(stamp, np.array([0.0, 0.0, 2.0]), WEIGHT + [0.0, 0.0, 4.0])
    state = estimator.update()
    np.testing.assert_allclose(state[1, 2], 4.0 * counted)
    assert state[1, 5] == (2.0 if counted else 0.0)
    np.testing.assert_allclose(state[0, 2], 3.0 + 2.0 * counted**2)
    np.testing.assert_allclose(state[0, 5], 2.0 * counted, atol=1e-15)
    # low-pass of 5 Hz on the acceleration
    np.testing.assert_allclose(state[2, 2], 4.0 * (1.0 - math.exp(-10.0 * math.pi * counted)))


@pytest.mark.parametrize(("stamp", "counted"), [(0.04, 0.04), (0.2, 0.05), (-0.1, 0.0)])
def test_joint_readings_count_for_the_time_since_the_last_but_50_ms_at_most(stamp, counted):
    estimator = started(
        joint_bandwidth=2.0, joint_velocity_weight=0.0, joint_acceleration_cutoff=ONE
    )
    estimator.joints(stamp, np.array([0.3, -0.2]) + counted * np.array([1.0, -2.0]), np.zeros(2))
    state = estimator.update()
    # the angles are where the rates lead: nothing to correct
    np.testing.assert_allclose(state[0, 6:], [0.3 + counted, -0.2 - 2.0 * counted])
    np.testing.assert_allclose(state[1, 6:], [1.0, -2.0])
    # omega = 1 on rates that the filter has at 0: dt e^-dt of them
    expected = counted * math.exp(-counted) * np.array([1.0, -2.0])
    np.testing.assert_allclose(state[2, 6:], expected, atol=1e-15)


def test_the_first_imu_sample_counts_for_no_time():
    estimator = StateEstimator(EstimatorParameters(), 2)
    estimator.mocap(0.0, NOTHING, LEVEL)
    estimator.imu(0.0, np.ones(3), 2.0 * WEIGHT)
    state = estimator.update()
    np.testing.assert_array_equal(state, np.zeros((3, 8)))


def test_a_jump_is_refused_while_the_estimate_is_trusted():
    estimator = StateEstimator(EstimatorParameters(), 2)
    for k in range(40):
        estimator.imu(0.04 * k, NOTHING, WEIGHT)
        estimator.mocap(0.04 * k, np.array([1e-6 * k + (k > 30), 0.0, 0.0]), LEVEL)
    assert estimator.refused_poses == 9


def test_it_predicts_only_from_a_pose_on():
    estimator = StateEstimator(EstimatorParameters(), 2)
    for stamp in (0.0, 0.01):
        estimator.imu(stamp, NOTHING, 2.0 * WEIGHT)
    assert not estimator.update()[1].any()
    assert not estimator.complete
    assert not estimator.update()[0, 3:6].any()
    estimator.mocap(0.01, NOTHING, np.array([HALF, 0.0, 0.0, HALF]))
    np.testing.assert_allclose(estimator.update()[0, 3:6], [0.0, 0.0, math.pi / 2])


@pytest.mark.parametrize(("gap", "refused"), [(0.05, 1), (0.06, 0)])
def test_an_imu_gap_of_more_than_50_ms_ends_the_trust_in_the_estimate(gap, refused):
    estimator = StateEstimator(EstimatorParameters(), 2)
    for k in range(-40, 1):  # 1.6 s until 0 s, exactly
        estimator.imu(0.04 * k, NOTHING, WEIGHT)
        estimator.mocap(0.04 * k, 1e-6 * np.array([k, 0.0, 0.0]), LEVEL)
    estimator.imu(gap, NOTHING, WEIGHT)
    estimator.mocap(gap, np.array([1.0, 0.0, 0.0]), LEVEL)
    assert estimator.refused_poses == refused


def test_new_parameters_are_those_of_the_next_sample():
    estimator = started()
    estimator.set_parameters(
        EstimatorParameters(position_bandwidth=2.0, attitude_bandwidth=3.0, pose_gate=7.0)
    )
    estimator.imu(0.04, NOTHING, WEIGHT)
    estimator.mocap(0.04, np.array([2.0, 2.0, 3.0]), np.array([0.8, 0.6, 0.0, 0.0]))
    state = estimator.update()
    # the first pose that is compared with a prediction: 50 ms; 3*2*.05, 3*4*.05, 2*3*.05*1.2
    np.testing.assert_allclose(state[0, :6], [1.3, 2.0, 3.0, 0.36, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(state[1, :3], [0.6, 0.0, 0.0])
    far = StateEstimator(EstimatorParameters(), 2)
    far.set_parameters(EstimatorParameters(pose_gate=7.0))
    for k in range(40):
        far.imu(0.04 * k, NOTHING, WEIGHT)
        far.mocap(0.04 * k, np.array([1e-6 * k + 5.0 * (k == 39), 0.0, 0.0]), LEVEL)
    assert far.refused_poses == 0  # 5 m off, 7 m are allowed


def test_age_of_poses_at_their_arrival():
    age = PoseAge()
    age_at(age.memory, 4_000_000)
    assert age.average is None and age.largest == 0
    for tick in range(2, 400):
        if tick % 2 == 0:
            age.pose((tick - 2) * 4_000_000 - (1_000_000 if tick == 100 else 0))
        age_at(age.memory, tick * 4_000_000)
    assert age.average == pytest.approx(8e6, abs=5e3)
    assert age.largest == 9_000_000
    age.restart()
    age_at(age.memory, 2_000_000_000)  # without a new pose
    assert age.largest == 0


def test_the_noise_of_an_odometry_moves_the_velocity_less():
    """6 mm at 60 Hz; what passes to the velocity grows with the bandwidth to the power of 1.5."""
    noise = np.random.default_rng(1).normal(0.0, 0.006, (600, 3))
    found = []
    for of_odometry in (False, True):
        estimator = started(position_bandwidth=12.0, odometry_bandwidth=6.0)
        if of_odometry:
            estimator.use_odometry()
        velocities = []
        for tick in range(1, 2401):
            if tick % 4 == 0:
                estimator.mocap(tick / 240.0, [1.0, 2.0, 3.0] + noise[tick // 4 - 1], LEVEL)
            estimator.imu(tick / 240.0, NOTHING, WEIGHT)
            velocities.append(estimator.update()[1, :3].copy())
        found.append(np.std(velocities[480:]))
    assert found[1] == pytest.approx(found[0] / 2.0**1.5, rel=0.25)
