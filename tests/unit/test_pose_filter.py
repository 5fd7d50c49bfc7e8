"""The pose filter's steps against hand-worked numbers: prediction, correction, late poses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uam_control.estimation.pose_filter import (
    correct,
    correct_waiting,
    filter_arrays,
    parts_of,
    predict,
    predict_next,
    shift,
    value_at,
    wait,
)

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
HALF = math.sqrt(0.5)
GRAVITY = 9.81
NOTHING, WEIGHT = np.zeros(3), np.array([0.0, 0.0, GRAVITY])
# a turn by twice the angle whose sine is .6, about (.6, .8, 0): its rotation error is (.72, .96, 0)
TURNED = np.array([0.8, 0.36, 0.48, 0.0])


def predicted(dt, gyro, force, quaternion=LEVEL, velocity=NOTHING, biases=(NOTHING, NOTHING)):
    """Predict from position (1, 2, 3); return all that it writes."""
    arrays = filter_arrays()
    motion, _, poses = parts_of(arrays.memory)
    arrays.numbers["gravity"] = GRAVITY
    motion.position[:], motion.velocity[:], motion.quaternion[:] = (1, 2, 3), velocity, quaternion
    motion.gyro_bias[:], motion.accelerometer_bias[:] = biases
    predict(arrays, dt, np.array(gyro), np.array(force), 1)
    np.testing.assert_array_equal(poses[1], [*motion.position, *motion.quaternion])
    assert not poses[[0, 2]].any()
    return motion[:5]


def test_prediction_without_a_turn():
    # gyro less its bias is 0; a = (1, 2, 10.81 - 9.81) - (.5, 1, -1) = (.5, 1, 2)
    position, velocity, quaternion, rates, acceleration = predicted(
        0.5, (0.1, 0.2, 0.3), (1.0, 2.0, 10.81), velocity=(2.0, 0.0, -2.0),
        biases=((0.1, 0.2, 0.3), (0.5, 1.0, -1.0)),
    )  # fmt: skip
    np.testing.assert_allclose(acceleration, [0.5, 1.0, 2.0])
    np.testing.assert_allclose(velocity, [2.25, 0.5, -1.0])  # + .5 a
    # + .5 (2, 0, -2) + .125 a
    np.testing.assert_allclose(position, [2.0625, 2.125, 2.25])
    np.testing.assert_array_equal(rates, 0.0)
    np.testing.assert_array_equal(quaternion, LEVEL)


def test_prediction_turns_first_and_keeps_the_quaternion_of_unit_length():
    # half a second at pi rad/s about z is a quarter turn: body x is world y
    _, velocity, quaternion, rates, _ = predicted(
        0.5, (0.0, 0.0, math.pi + 0.25), (2.0, 4.0, 9.81), 2.0 * LEVEL,
        biases=((0.0, 0.0, 0.25), NOTHING),
    )  # fmt: skip
    np.testing.assert_allclose(rates, [0.0, 0.0, math.pi])
    np.testing.assert_allclose(quaternion, [HALF, 0.0, 0.0, HALF])
    np.testing.assert_allclose(velocity, [-2.0, 1.0, 0.0], atol=1e-15)


def test_correction_gains():
    # position, w = 2: 3w dt = .6, 3w^2 dt = 1.2, w^3 dt = .8 times (.5, -1, .25)
    # attitude, w = 3: 2w dt = .6 and w^2 dt = .9 times (.72, .96, 0)
    arrays = filter_arrays()
    motion, _, _ = parts_of(arrays.memory)
    position, velocity, quaternion, _, _, gyro_bias, accelerometer_bias = motion
    position[:], arrays.used[:] = 1.0, (2.0, 3.0)
    arrays.memory[-7:] = 0.5, 1.0, 1.75, *LEVEL
    correct(arrays, 0.1, np.array([1.0, 0.0, 2.0]), TURNED)
    np.testing.assert_allclose(position, [1.3, 0.4, 1.15])
    np.testing.assert_allclose(velocity, [0.6, -1.2, 0.3])
    np.testing.assert_allclose(accelerometer_bias, [-0.4, 0.8, -0.2])
    np.testing.assert_allclose(gyro_bias, [-0.648, -0.864, 0.0])
    # the turn is .6 * 1.2 = .72 rad about (.6, .8, 0)
    half = math.sin(0.36)
    np.testing.assert_allclose(quaternion, [math.cos(0.36), 0.6 * half, 0.8 * half, 0.0])


@pytest.mark.parametrize(
    ("stamp", "at", "gap", "value"),
    [
        (1.02, 1.02, 0.0, 2.0),
        (1.005, 1.005, 0.02, 0.5),  # a quarter of the way from 1.00 to 1.02
        (1.02 + 5e-7, 1.02, 0.0, 2.0),  # half a microsecond: the same moment
        (1.035, 1.02, 0.0, 2.0),  # beside a gap of 60 ms the nearest
        (1.065, 1.08, 0.0, 8.0),
        (0.5, 1.0, 0.0, 0.0),  # before the oldest
        (2.0, 1.08, 0.0, 8.0),  # after the newest
    ],
)
def test_the_value_at_a_stamp(stamp, at, gap, value):
    # a ring whose newest row is 1, the oldest 2
    stamps, rows, found = np.array([1.02, 1.08, 1.0]), np.array([[2.0], [8.0], [0.0]]), np.zeros(1)
    assert value_at(stamps, rows, 1, stamp, found) == pytest.approx((at, gap))
    assert found[0] == pytest.approx(value)


def test_what_was_predicted_since_a_stamp_is_shifted():
    arrays = filter_arrays()
    _, stamps, poses = parts_of(arrays.memory)
    stamps[:3], arrays.numbers["compared"] = (3.0, 1.0, 2.0), 2.0
    poses[:3, 3] = 1.0
    poses[:3, 0] = 30.0, 10.0, 20.0
    shift(arrays, np.array([5.0, 6.0, 7.0]), np.array([1.0, 0.5, -1.0]), TURNED)
    # newest by (5, 6, 7); a second before by the velocity less; before `since` not at all
    np.testing.assert_allclose(poses[0], [35.0, 6.0, 7.0, *TURNED])
    np.testing.assert_allclose(poses[2], [24.0, 5.5, 8.0, *TURNED])
    np.testing.assert_array_equal(poses[1], [10.0, 0.0, 0.0, *LEVEL])


class Filter:
    """A filter with bandwidths 2 and 3 rad/s whose gate refuses poses that are 10 m away."""

    def __init__(self) -> None:
        self.arrays = filter_arrays()
        self.arrays.bandwidths[:] = 2.0, 3.0, 3.0
        self.arrays.gate["distance"], self.arrays.numbers["gravity"] = 10.0, GRAVITY
        self.motion, _, _ = parts_of(self.arrays.memory)
        self.position, self.velocity, self.quaternion, *_ = self.motion

    def predict(self, stamp, dt, gyro, force):
        predict_next(self.arrays, stamp, dt, gyro, force)

    def correct(self, stamp, position, quaternion):
        wait(self.arrays, stamp, position, quaternion)
        correct_waiting(self.arrays)

    @property
    def ahead(self) -> list:
        """Stamp and pose of each that waits."""
        return self.arrays.ahead[: self.arrays.numbers["waiting"].item()].tolist()

    @property
    def refused(self) -> int:
        return self.arrays.gate["refused"].item()


def at_rest(stamps, position=NOTHING) -> Filter:
    """A filter that has been at rest at the stamps."""
    found = Filter()
    found.position[:] = position
    for stamp in stamps:
        found.predict(stamp, 0.01, NOTHING, WEIGHT)
    return found


def test_it_begins_level_and_at_rest():
    motion = Filter().motion
    np.testing.assert_array_equal(motion.quaternion, LEVEL)
    rest = motion._replace(quaternion=NOTHING)
    np.testing.assert_array_equal(rest, np.zeros((7, 3)))


def test_corrections_count_for_the_time_since_the_last_but_no_less_than_1_ms():
    found = at_rest([0.0, 0.01, 0.0105])
    gain = 6.0  # 3w per second
    found.correct(0.0, np.array([1.0, 0.0, 0.0]), LEVEL)  # the first counts for 50 ms
    np.testing.assert_allclose(found.position, [gain * 0.05, 0.0, 0.0])
    found.correct(0.01, np.array([0.0, 1.0, 0.0]), LEVEL)
    np.testing.assert_allclose(found.position, [gain * 0.05, gain * 0.01, 0.0])
    found.correct(0.0105, np.array([0.0, 0.0, 1.0]), LEVEL)
    np.testing.assert_allclose(found.position, [gain * 0.05, gain * 0.01, gain * 0.001])


def test_of_sparse_poses_each_corrects_by_the_same_share():
    """Bandwidth times interval is 0.3 at most: the position moves by 3 · 0.3 of the difference."""
    for interval in (0.2, 0.5, 2.0):
        found = at_rest([0.0])
        found.correct(0.0, NOTHING, LEVEL)
        found.predict(interval, 0.01, NOTHING, WEIGHT)
        found.correct(interval, np.array([0.1, 0.0, 0.0]), LEVEL)
        np.testing.assert_allclose(found.position, [0.09, 0.0, 0.0])
        np.testing.assert_allclose(found.velocity, [3.0 * 0.09 / interval * 0.1, 0.0, 0.0])


def test_beside_a_gap_a_prediction_is_compared_with_one_pose():
    found = at_rest([0.0, 0.1])
    for stamp in (0.0, 0.008, 0.016):
        found.correct(stamp, np.array([1.0, stamp, 0.0]), LEVEL)
    # 3w dt = .3, and 100 ms since then with 3w^2 dt = .6
    np.testing.assert_allclose(found.position, [0.36, 0.0, 0.0])


def test_poses_ahead_of_the_imu_wait_for_their_samples_in_order_of_their_stamps():
    found = at_rest([0.0])
    found.correct(0.1, np.array([1.0, 0.0, 0.0]), LEVEL)
    found.correct(0.085, np.array([0.0, 1.0, 0.0]), LEVEL)
    assert not found.position.any()
    found.predict(0.09, 0.01, NOTHING, WEIGHT)
    assert found.position[1] == pytest.approx(0.3) and found.position[0] == 0.0
    found.predict(0.11, 0.01, NOTHING, WEIGHT)
    assert found.position[0] > 0.0 and not found.ahead
    for stamp in np.linspace(0.12, 0.15, 300):  # more than are kept
        found.correct(stamp, np.array([stamp, 0.0, 0.0]), LEVEL)
    assert len(found.ahead) == 256 and found.ahead[0][0] > 0.12


def test_a_pose_between_two_samples_is_compared_with_the_motion_between_them():
    """At 2 m/s the poses of 0.0125 and 0.015 s agree with the predictions: nothing changes."""
    found = at_rest([0.0])
    found.velocity[0] = 2.0
    for stamp in (0.01, 0.02):
        found.predict(stamp, 0.01, NOTHING, WEIGHT)
    for stamp in (0.0125, 0.015):
        found.correct(stamp, np.array([2.0 * stamp, 0.0, 0.0]), LEVEL)
    np.testing.assert_allclose([found.position[0], found.velocity[0]], [0.04, 2.0], atol=1e-12)


@pytest.mark.parametrize("before", [0.0, 0.03])
@pytest.mark.parametrize("step", [0.06, 0.3])
def test_poses_of_a_clock_that_is_ahead_are_refused_until_it_is_right_again(before, step):
    """The clock of the poses is set forward: waiting, they would count late by its step."""
    found, place = at_rest([0.0]), np.zeros(3)
    for tick in range(1, 501):
        now, place[0] = 0.004 * tick, 0.0 if tick <= 50 else 0.1
        place[1] = 1e-6 * tick  # no repeat
        found.predict(now, 0.004, NOTHING, WEIGHT)
        found.correct(now + (before if tick <= 50 else step), place, LEVEL)
    assert found.refused > 300 and not found.ahead and found.position[0] == 0.0
    found.predict(2.004, 0.004, NOTHING, WEIGHT)
    found.correct(2.004, place, LEVEL)
    assert found.position[0] > 0.0


def test_poses_that_came_while_the_imu_paused_are_used_with_its_samples():
    found = at_rest([0.0])
    for stamp in np.arange(0.008, 0.2, 0.008):
        found.correct(stamp, np.array([0.1, 0.0, 1e-6 * stamp]), LEVEL)
    for stamp in np.arange(0.004, 0.2, 0.004):
        found.predict(stamp, 0.004, NOTHING, WEIGHT)
    assert not found.refused and not found.ahead and found.position[0] > 0.05


@pytest.mark.parametrize(("stamp", "used"), [(0.02, True), (0.021, False), (-0.02, True)])
def test_a_pose_needs_a_prediction_within_20_ms(stamp, used):
    found = at_rest([0.0, 0.1])
    found.correct(stamp, np.array([1.0, 0.0, 0.0]), LEVEL)
    assert found.position[0] == pytest.approx(0.36 if used else 0.0)


def test_a_pose_up_to_a_second_late_is_used_and_the_later_the_slower_it_corrects():
    stamps = [0.004 * k for k in range(300)]
    for late, share in ((0.0, 0.3), (0.2, 0.225), (1.0, 0.045), (1.004, 0.0)):
        found = at_rest(stamps)
        found.correct(stamps[-1] - late, np.array([1.0, 0.0, 0.0]), LEVEL)
        # 3 w dt, with w of 2 rad/s or, less, 0.3 / 0.2 s / late; and 3 w^2 dt late since then
        w = min(2.0, 1.5 / late) if late else 2.0
        expected = 0.05 * (3.0 * w + 3.0 * w**2 * late) * (share > 0.0)
        assert found.position[0] == pytest.approx(expected)
        assert found.refused == (share == 0.0)


def test_a_repeated_pose_is_used_once():
    found = at_rest([0.0])
    for _ in range(2):
        found.correct(0.0, np.array([1.0, 0.0, 0.0]), LEVEL)
    np.testing.assert_allclose(found.position, [0.3, 0.0, 0.0])


def test_a_pose_later_than_30_ms_corrects_the_predictions_since():
    found = at_rest([0.0, 0.01, 0.02, 0.03, 0.04, 0.05])
    found.correct(0.01, np.array([0.5, 0.0, 0.0]), TURNED)
    # dt .05: velocity by 12*.05*.5 = .3; position by 6*.05*.5 = .15, and .04*.3 since then
    np.testing.assert_allclose(found.velocity, [0.3, 0.0, 0.0])
    np.testing.assert_allclose(found.position, [0.162, 0.0, 0.0])
    # turned by 2*3*.05*1.2 = .36 rad about (.6, .8, 0)
    half = math.sin(0.18)
    turned = np.array([math.cos(0.18), 0.6 * half, 0.8 * half, 0.0])
    np.testing.assert_allclose(found.quaternion, turned)
    # poses that agree with the shifted predictions change nothing: .15 + .01*.3 at .02 s
    before = found.velocity.copy(), found.motion.gyro_bias.copy()
    for stamp, x in ((0.02, 0.153), (0.04, 0.159), (0.01, 0.15)):
        found.correct(stamp, np.array([x, 0.0, 0.0]), turned)
    found.correct(0.0, NOTHING, LEVEL)  # nor does one before the correction
    np.testing.assert_allclose(found.position, [0.162, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.velocity, before[0], atol=1e-12)
    np.testing.assert_allclose(found.motion.gyro_bias, before[1], atol=1e-12)
    np.testing.assert_allclose(found.quaternion, turned, atol=1e-12)


def test_a_pose_of_30_ms_does_not():
    found = at_rest([0.0, 0.01, 0.02, 0.03])
    found.correct(0.0, np.array([0.5, 0.0, 0.0]), LEVEL)
    np.testing.assert_allclose(found.position, [0.15, 0.0, 0.0])
    found.correct(0.01, NOTHING, LEVEL)  # agrees with the prediction as it was
    np.testing.assert_allclose(found.position, [0.15, 0.0, 0.0])


def test_other_bandwidths_from_the_next_pose_on():
    found = at_rest([0.0], (1.0, 2.0, 3.0))
    np.testing.assert_array_equal(found.position, [1.0, 2.0, 3.0])
    found.arrays.bandwidths[:] = 4.0, 1.0, 4.0
    found.correct(0.0, np.array([2.0, 2.0, 3.0]), TURNED)
    # 3*4*.05, 3*16*.05, 64*.05; attitude 1*.05*(.72, .96, 0)
    np.testing.assert_allclose(found.position, [1.6, 2.0, 3.0])
    np.testing.assert_allclose(found.velocity, [2.4, 0.0, 0.0])
    np.testing.assert_allclose(found.motion.accelerometer_bias, [-3.2, 0.0, 0.0])
    np.testing.assert_allclose(found.motion.gyro_bias, [-0.036, -0.048, 0.0])
