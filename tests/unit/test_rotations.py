"""Rotations against the paper's matrix and each other."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from uam_control.maths import rotations as r

angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)).map(np.array)
small = st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array)


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
    np.testing.assert_allclose(r.relative_rotation(matrix, matrix), np.eye(3), atol=1e-12)


@given(st.floats(-50, 50))
def test_wrapped_angle_is_the_same_direction(angle):
    wrapped = r.wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    np.testing.assert_allclose(
        [np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)], atol=1e-9
    )
