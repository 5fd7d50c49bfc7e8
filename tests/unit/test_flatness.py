"""Attitude, body rates and their derivatives from the motion of position and yaw."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.mission.motion.flatness import write_reference
from uam_control.mission.motion.polynomials import Polynomials

NO_DRAG, G, FREE = np.zeros(3), 9.81, 1e6
COEFFICIENT = st.floats(-2.0, 2.0)


def attitude(motion, drag=NO_DRAG, rate_max=FREE, acceleration_max=FREE):
    reference = np.zeros((3, 8))
    write_reference(motion, np.array(drag), G, rate_max, acceleration_max, reference)
    return reference[:, 3:5]


def test_by_hand_an_acceleration_of_g_ahead_is_a_pitch_of_45_degrees():
    motion = np.zeros((5, 8))
    motion[2, 0] = G
    np.testing.assert_allclose(attitude(motion), [[0.0, math.pi / 4], [0, 0], [0, 0]], atol=1e-12)
    motion[0, 5] = math.pi / 2  # heading north: the force is to the right, a positive roll
    np.testing.assert_allclose(attitude(motion)[0], [math.pi / 4, 0.0], atol=1e-12)


def test_by_hand_jerk_and_snap_at_rest_are_rate_and_acceleration_times_g():
    motion = np.zeros((5, 8))
    motion[3, 0], motion[4, 1] = 2.0, 3.0
    found = attitude(motion)
    np.testing.assert_allclose(found[1], [0.0, 2.0 / G])
    np.testing.assert_allclose(found[2], [-3.0 / G, 0.0])


def test_by_hand_drag_of_a_constant_speed_leans_the_vehicle_forward():
    motion = np.zeros((5, 8))
    motion[1, 0] = 2.0
    assert attitude(motion, (0.1, 0.1, 0.1))[0, 1] == pytest.approx(math.atan(0.2 / G))


@given(st.lists(COEFFICIENT, min_size=32, max_size=32), st.floats(0.1, 0.9))
def test_rates_are_the_derivatives_of_the_angles(numbers, time):
    """Any polynomial motion of position and yaw; acceleration stays above free fall."""
    coefficients = np.array(numbers).reshape(1, 8, 4)
    coefficients[:, 2:, 2] *= 0.1  # z: no free fall
    coefficients[:, 3:, 2] *= 0.1
    curve, step = Polynomials(np.array([0.0, 1.0]), coefficients), 1e-5
    found = []
    for at in (time - step, time, time + step):
        motion = np.zeros((5, 8))
        motion[:, [0, 1, 2, 5]] = curve.rows(np.array([at]))[:, 0]
        found.append(attitude(motion, (0.1, 0.1, 0.2)))
    before, now, after = found
    np.testing.assert_allclose((after[0] - before[0]) / (2 * step), now[1], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * step), now[2], rtol=1e-2, atol=1e-1)


def test_steps_of_the_jerk_are_bounded_and_free_fall_is_level():
    motion = np.zeros((5, 8))
    motion[3, 0], motion[4, 1] = 1e4, -1e6
    found = attitude(motion, rate_max=8.0, acceleration_max=40.0)
    assert found[1, 1] == 8.0 and found[2, 0] == 40.0
    motion[2, 2] = -G
    np.testing.assert_array_equal(attitude(motion), 0.0)
    motion[2, 2] = 0.0009 * G - G  # less than a thousandth of the weight is free fall, too
    np.testing.assert_array_equal(attitude(motion), 0.0)
    motion[2, 2] = 0.0011 * G - G
    assert attitude(motion)[1, 1] != 0.0


def test_by_hand_a_vertical_jerk_turns_the_vehicle_that_leans():
    """3 m/s^2 to the right, 4 m/s^2 upwards and a jerk of 1: roll = atan(3 / (4 + t))."""
    motion = np.zeros((5, 8))
    motion[2, 1:3], motion[3, 2] = (-3.0, 4.0 - G), 1.0
    roll = attitude(motion)[:, 0]
    np.testing.assert_allclose(roll, [math.atan(0.75), -3.0 / 25.0, 2.0 * 3.0 * 4.0 / 625.0])
