"""Rotations against the paper's matrix and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.maths import rotations as r

angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)).map(np.array)
small = st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array)

# angles of the 3-4-5 triangle: A has cosine 0.8 and sine 0.6, B the other way round
A, B = math.atan2(0.6, 0.8), math.atan2(0.8, 0.6)
HALF = math.sqrt(0.5)


def test_matrix_of_euler_angles_by_hand():
    # cr .6, sr .8, cp .8, sp .6, cy .8, sy .6
    expected = [[0.64, 0.024, 0.768], [0.48, 0.768, -0.424], [-0.6, 0.64, 0.48]]
    np.testing.assert_allclose(r.matrix_from_euler(np.array([B, A, A])), expected, atol=1e-15)


def test_products_by_hand():
    """No rotations, but whole numbers."""
    m = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 10.0]])
    v = np.array([1.0, 2.0, -1.0])
    np.testing.assert_array_equal(r.rotate(m, v), [2.0, 8.0, 13.0])
    np.testing.assert_array_equal(r.rotate_back(m, v), [2.0, 4.0, 5.0])
    q = np.array([1.0, 2.0, 3.0, 4.0])
    expected = [[-49.0, 4.0, 22.0], [20.0, -39.0, 20.0], [10.0, 28.0, -25.0]]
    np.testing.assert_array_equal(r.matrix_from_quaternion(q), expected)
    product = r.quaternion_multiply(q, np.array([5.0, 6.0, 7.0, 8.0]))
    np.testing.assert_array_equal(product, [-60.0, 12.0, 30.0, 24.0])


def test_quaternion_of_euler_angles_by_hand_and_back():
    # half angles: cr .8, sr .6, cp .8, sp .6, cy .6, sy .8
    euler, q = np.array([2.0 * A, 2.0 * A, 2.0 * B]), np.array([0.672, -0.096, 0.672, 0.296])
    np.testing.assert_allclose(r.quaternion_from_euler(euler), q, atol=1e-15)
    np.testing.assert_allclose(r.euler_from_quaternion(q), euler)
    # beyond a turn of pi the other sign is the one with w >= 0
    q = r.quaternion_from_euler(np.array([0.0, 0.0, 4.0]))
    np.testing.assert_allclose(q, [-math.cos(2.0), 0.0, 0.0, -math.sin(2.0)])


def test_a_pitch_that_is_rounded_beyond_a_quarter_turn_is_one():
    for sign in (1.0, -1.0):
        q = np.array([HALF, 0.0, sign * HALF, 0.0]) * (1.0 + 1e-15)
        assert r.euler_from_quaternion(q)[1] == sign * math.pi / 2.0


def test_quaternion_of_a_rotation_vector_by_hand():
    q = r.quaternion_from_rotation_vector(2.0 * A * np.array([0.6, 0.0, -0.8]))
    np.testing.assert_allclose(q, [0.8, 0.36, 0.0, -0.48])
    q = r.quaternion_from_rotation_vector(0.5 * np.array([0.0, 0.6, 0.8]))
    np.testing.assert_allclose(
        q, [math.cos(0.25), 0.0, 0.6 * math.sin(0.25), 0.8 * math.sin(0.25)], rtol=1e-14
    )
    np.testing.assert_array_equal(r.quaternion_from_rotation_vector(np.zeros(3)), [1, 0, 0, 0])
    # just below the angle from which on it divides
    small = r.quaternion_from_rotation_vector(np.array([0.0, 9e-5, 0.0]))
    np.testing.assert_allclose(small[2], math.sin(4.5e-5), rtol=1e-13)


def test_rotation_error_by_hand():
    # a turn by twice the angle whose sine is .6, about (.6, .8, 0)
    turn, yawed = np.array([0.8, 0.36, 0.48, 0.0]), np.array([HALF, 0.0, 0.0, HALF])
    for actual in (np.array([1.0, 0.0, 0.0, 0.0]), yawed, np.array([0.5, -0.5, 0.5, 0.5])):
        reference = r.quaternion_multiply(actual, turn)
        np.testing.assert_allclose(r.rotation_error(reference, actual), [0.72, 0.96, 0], atol=1e-15)
        np.testing.assert_allclose(
            r.rotation_error(-reference, actual), [0.72, 0.96, 0.0], atol=1e-15
        )
    half_turn = r.rotation_error(np.array([0.0, 1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    np.testing.assert_array_equal(half_turn, [2.0, 0.0, 0.0])


def test_wrapped_angles_by_hand():
    assert r.wrap_angle(math.pi) == r.wrap_angle(-math.pi) == -math.pi
    wrapped = r.wrap_angle(np.array([0.0, 3.5, -3.5, 7.0]))
    tau = 2.0 * math.pi
    np.testing.assert_allclose(wrapped, [0.0, 3.5 - tau, tau - 3.5, 7.0 - tau], atol=1e-15)


@given(angles)
def test_euler_quaternion_matrix_agree(euler):
    matrix = r.matrix_from_euler(euler)
    quaternion = r.quaternion_from_euler(euler)
    np.testing.assert_allclose(r.matrix_from_quaternion(quaternion), matrix, atol=1e-12)
    np.testing.assert_allclose(
        r.matrix_from_euler(r.euler_from_quaternion(quaternion)), matrix, atol=1e-6
    )
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) > 0.999


def test_matrix_is_z_y_x():
    """The paper's R_B^W: yaw about z, then pitch about y, then roll about x."""
    np.testing.assert_allclose(
        r.matrix_from_euler(np.array([0, 0, np.pi / 2])) @ [1, 0, 0], [0, 1, 0], atol=1e-12
    )
    np.testing.assert_allclose(
        r.matrix_from_euler(np.array([0, 0.3, 0])) @ [0, 0, 1],
        [np.sin(0.3), 0, np.cos(0.3)],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        r.matrix_from_euler(np.array([0.3, 0, 0])) @ [0, 0, 1],
        [0, -np.sin(0.3), np.cos(0.3)],
        atol=1e-12,
    )


@given(angles, angles)
def test_product_of_quaternions_is_product_of_matrices(a, b):
    qa, qb = r.quaternion_from_euler(a), r.quaternion_from_euler(b)
    np.testing.assert_allclose(
        r.matrix_from_quaternion(r.quaternion_multiply(qa, qb)),
        r.matrix_from_quaternion(qa) @ r.matrix_from_quaternion(qb),
        atol=1e-12,
    )


@given(angles, small)
def test_rotation_error_finds_a_small_turn_in_the_body_frame(euler, turn):
    actual = r.quaternion_from_euler(euler)
    reference = r.quaternion_multiply(actual, r.quaternion_from_rotation_vector(turn))
    error = r.rotation_error(reference, actual)
    np.testing.assert_allclose(error, turn, atol=np.linalg.norm(turn) ** 3 / 20 + 1e-9)
    np.testing.assert_allclose(r.rotation_error(-reference, actual), error, atol=1e-12)


@given(angles, small)
def test_rotate_and_back(euler, v):
    matrix = r.matrix_from_euler(euler)
    np.testing.assert_allclose(r.rotate(matrix, v), matrix @ v, atol=1e-12)
    np.testing.assert_allclose(r.rotate_back(matrix, r.rotate(matrix, v)), v, atol=1e-12)


@given(st.floats(-50, 50))
def test_wrapped_angle_is_the_same_direction(angle):
    wrapped = r.wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    np.testing.assert_allclose(
        [np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)], atol=1e-9
    )


def test_the_attitude_of_a_force_by_hand():
    # yaw A: the force's share to the right is .6*4.36 + .8*.48 = 3 of 5, forward 3.2 to 2.4 up
    force = np.array([4.36, -0.48, 2.4])
    for size in (1.0, 1e-3, 100.0):
        np.testing.assert_allclose(r.thrust_attitude(size * force, A), [A, B], atol=1e-14)
    assert r.thrust_attitude(np.zeros(3), A) == (0.0, 0.0)


def test_body_rates_of_euler_rates_by_hand():
    # sin roll .6, cos roll .8, sin pitch .8, cos pitch .6
    found = r.body_rates(A, B, 1.0, 2.0, 3.0)
    np.testing.assert_allclose(found, [1.0 - 2.4, 1.6 + 1.08, -1.2 + 1.44])


def test_tilt_by_hand():
    assert r.tilt(np.array([A, B, 9.0])) == pytest.approx(math.acos(0.48))
    assert r.tilt(np.array([A, math.pi - B, 9.0])) == pytest.approx(math.acos(-0.48))
