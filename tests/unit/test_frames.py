"""ENU/FLU ↔ NED/FRD: hand-worked cases, handedness, consistency of the conversions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control import frames
from uam_control.maths.rotations import (
    euler_from_quaternion,
    matrix_from_quaternion,
    quaternion_from_euler,
)

small = st.floats(-100.0, 100.0)
vectors = st.tuples(small, small, small).map(np.array)
eulers = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)).map(np.array)

HALF = math.sqrt(0.5)


def test_known_vectors():
    assert frames.swap_world(np.array([1.0, 2.0, 3.0])) == pytest.approx([2.0, 1.0, -3.0])
    assert frames.swap_body(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, -2.0, -3.0])


@pytest.mark.parametrize(
    ("enu", "ned"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2)),  # nose east
        ((0.0, 0.0, math.pi / 2), (0.0, 0.0, 0.0)),  # nose north
        ((0.1, 0.2, 0.0), (0.1, -0.2, math.pi / 2)),  # right side down; nose down is -pitch in FRD
        ((0.0, 0.0, math.pi), (0.0, 0.0, -math.pi / 2)),  # nose west
        ((0.0, 0.0, -3.0), (0.0, 0.0, 3.0 - 1.5 * math.pi)),  # pi/2 + 3 is beyond pi
        ((0.0, 0.0, -9.0), (0.0, 0.0, 9.0 - 3.5 * math.pi)),
    ],
)
def test_known_euler(enu, ned):
    assert frames.swap_euler(np.array(enu)) == pytest.approx(ned)


def test_level_nose_east_is_a_quarter_turn_from_north():
    q = frames.swap_quaternion(np.array([1.0, 0.0, 0.0, 0.0]))
    assert q == pytest.approx([HALF, 0.0, 0.0, HALF])


@given(vectors)
def test_maps_are_their_own_inverses(v):
    assert frames.swap_world(frames.swap_world(v)) == pytest.approx(v)
    assert frames.swap_body(frames.swap_body(v)) == pytest.approx(v)


@given(vectors, vectors)
def test_handedness_is_kept(a, b):
    for swap in (frames.swap_world, frames.swap_body):
        assert np.cross(swap(a), swap(b)) == pytest.approx(swap(np.cross(a, b)), abs=1e-9)


@given(eulers, vectors)
def test_quaternion_map_agrees_with_the_vector_maps(euler, v):
    """Rotation in FLU/ENU then conversion equals conversion then rotation in FRD/NED."""
    q = quaternion_from_euler(euler)
    swapped = frames.swap_quaternion(q)
    assert np.linalg.norm(swapped) == pytest.approx(1.0)
    converted = frames.swap_world(matrix_from_quaternion(q) @ v)
    rotated = matrix_from_quaternion(swapped) @ frames.swap_body(v)
    assert rotated == pytest.approx(converted, abs=1e-9)
    assert frames.swap_quaternion(swapped) == pytest.approx(q)


@given(eulers)
def test_euler_map_agrees_with_the_quaternion_map(euler):
    by_quaternion = euler_from_quaternion(frames.swap_quaternion(quaternion_from_euler(euler)))
    difference = by_quaternion - frames.swap_euler(euler)
    assert np.sin(difference / 2) == pytest.approx(0.0, abs=1e-6)
