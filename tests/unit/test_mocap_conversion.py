"""Tracker's axes and pivot → world ENU and body FLU: hand-worked values and properties."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tracked_vehicle import TrackedBody

from uam_control.maths.rotations import (
    euler_from_quaternion,
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_multiply,
)
from uam_control.settings.configuration import ConfigurationError
from uam_sim_bridge.devices.mocap import calibration as calibrations
from uam_sim_bridge.devices.mocap.calibration import Calibration, conjugate, world_rotation
from uam_sim_bridge.devices.mocap.frame import BodyPose, MocapError

HALF = math.sqrt(0.5)
Y_UP = calibrations.load("motive_y_up")
Z_UP = calibrations.load("motive_z_up")
numbers = st.floats(-5.0, 5.0)
vectors = st.tuples(numbers, numbers, numbers)
angles = st.floats(-3.1, 3.1)
eulers = st.tuples(angles, st.floats(-1.5, 1.5), angles)


def pose(position, quaternion=(1.0, 0.0, 0.0, 0.0)):
    return BodyPose(np.array(position, dtype=float), np.array(quaternion, dtype=float))


def quaternion(euler):
    return quaternion_from_euler(np.array(euler, dtype=float))


def same_rotation(a, b):
    np.testing.assert_allclose(matrix_from_quaternion(a), matrix_from_quaternion(b), atol=1e-8)


@pytest.mark.parametrize(
    ("tracker", "world"),
    [
        ((1, 0, 0), (1, 0, 0)),
        ((0, 1, 0), (0, 0, 1)),
        ((0, 0, 1), (0, -1, 0)),
        ((1, 2, 3), (1, -3, 2)),
    ],
)
def test_motives_y_is_up_and_its_z_points_to_the_right_of_x(tracker, world):
    position, turned = Y_UP.convert(pose(tracker))
    np.testing.assert_allclose(position, world, atol=1e-7)
    same_rotation(turned, np.array([1.0, 0, 0, 0]))


@pytest.mark.parametrize(
    ("motive", "euler"),
    [
        ((HALF, 0.0, HALF, 0.0), (0.0, 0.0, 90.0)),  # about its Y, up: a turn to the left
        ((HALF, HALF, 0.0, 0.0), (90.0, 0.0, 0.0)),  # about its X, the nose: a roll to the right
        ((HALF, 0.0, 0.0, HALF), (0.0, -90.0, 0.0)),  # about its Z, to the right: nose up
    ],
)
def test_turns_about_motives_axes(motive, euler):
    _, turned = Y_UP.convert(pose((0, 0, 0), motive))
    same_rotation(turned, quaternion(np.radians(euler)))


def test_a_roll_of_ten_degrees_in_numbers():
    roll = math.radians(10.0)
    motive = (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0)
    _, turned = Y_UP.convert(pose((0, 0, 0), motive))
    np.testing.assert_allclose(np.degrees(euler_from_quaternion(turned)), (10, 0, 0), atol=1e-5)


def test_z_up_changes_nothing():
    position, turned = Z_UP.convert(pose((1, 2, 3), (HALF, 0, 0, HALF)))
    np.testing.assert_allclose(position, (1, 2, 3))
    np.testing.assert_allclose(turned, (HALF, 0, 0, HALF), atol=1e-12)


def test_heading_turns_the_world_about_up():
    turned = Calibration("y", math.radians(90), (0.0,) * 3, Y_UP.body, (0.0,) * 3, {})
    position, q = turned.convert(pose((1.0, 2.0, 0.0)))
    np.testing.assert_allclose(position, (0.0, 1.0, 2.0), atol=1e-9)
    np.testing.assert_allclose(np.degrees(euler_from_quaternion(q)), (0, 0, 90), atol=1e-6)


def test_the_pivot_is_subtracted_in_the_bodys_axes_and_the_origin_in_the_worlds():
    made = Calibration("z", 0.0, (10.0, 0.0, 0.0), (1.0, 0, 0, 0), (0.1, 0.0, 0.05), {})
    position, _ = made.convert(pose((11.0, 0.0, 0.0), (HALF, 0, 0, HALF)))  # nose to +y
    np.testing.assert_allclose(position, (1.0, -0.1, -0.05), atol=1e-12)


def test_a_payload_needs_no_calibration_of_its_own():
    made = Calibration("y", 0.3, (1.0, 2.0, 0.0), (0.5, 0.5, 0.5, 0.5), (0.1, 0.1, 0.1), {"a": 1})
    position, turned = made.without_body().convert(pose((0.0, 0.4, 0.0)))
    np.testing.assert_allclose(position, (-1.0, -2.0, 0.4), atol=1e-9)
    same_rotation(turned, np.array([1.0, 0, 0, 0]))


@given(vectors, eulers, eulers, vectors, st.sampled_from("yz"), angles)
def test_the_pose_that_a_tracker_sees_is_converted_back(at, euler, made_at, pivot, up, heading):
    """The emulated tracker is written apart: rotation since the body was made, its own axes."""
    pivot = tuple(0.2 * value for value in pivot)
    made = quaternion(made_at)
    body = TrackedBody("uam", up, tuple(made), pivot)
    true_at, true_turn = np.array(at), quaternion(euler)
    seen_at, seen_turn = body.seen(true_at, true_turn)
    to_body = quaternion_multiply(conjugate(world_rotation(up, 0.0)), made)
    calibrated = Calibration(up, heading, (0.0,) * 3, tuple(to_body), pivot, {})
    position, turned = calibrated.convert(pose(seen_at, np.roll(seen_turn, 1)))
    about_up = quaternion((0.0, 0.0, heading))  # the world is turned against the tracker's
    np.testing.assert_allclose(position, matrix_from_quaternion(about_up) @ true_at, atol=1e-8)
    same_rotation(turned, quaternion_multiply(about_up, true_turn))
    assert abs(np.linalg.norm(turned) - 1.0) < 1e-9 and turned[0] >= 0.0


@given(vectors, vectors, eulers)
def test_distances_and_angles_are_kept(a, b, euler):
    first, _ = Y_UP.convert(pose(a, quaternion(euler)))
    second, _ = Y_UP.convert(pose(b, quaternion(euler)))
    expected = np.linalg.norm(np.array(a) - np.array(b))
    assert np.linalg.norm(first - second) == pytest.approx(expected, abs=1e-7)


@given(st.sampled_from("yz"), st.floats(-180, 180), vectors, eulers, vectors)
def test_a_written_calibration_is_read_back(tmp_path_factory, up, heading, origin, euler, pivot):
    pivot = tuple(0.1 * value for value in pivot)
    made = Calibration(
        up, math.radians(heading), origin, tuple(quaternion(euler)), pivot, {"distance_m": 1.0}
    )
    file = tmp_path_factory.getbasetemp() / "calibration.yaml"
    file.write_text(calibrations.text(made))
    read = calibrations.load(str(file))
    assert read.up == up and read.measured == {"distance_m": 1.0}
    np.testing.assert_allclose(math.degrees(read.heading), heading, atol=1e-3, rtol=1e-5)
    np.testing.assert_allclose(read.origin, origin, atol=1e-5)
    np.testing.assert_allclose(read.body, made.body, atol=1e-8)
    np.testing.assert_allclose(read.pivot, pivot, atol=1e-5)


GOOD = "up: y\nheading_deg: 0\norigin: [0, 0, 0]\nbody: [1, 0, 0, 0]\npivot: [0, 0, 0]\n"


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (GOOD.replace("up: y", "up: x"), "up: 'x' is not one of y, z"),
        (GOOD.replace("[1, 0, 0, 0]", "[1, 1, 0, 0]"), "body: norm 1.414, 1 expected"),
        (GOOD.replace("[1, 0, 0, 0]", "[1, 0, 0]"), "body: a list of 4 numbers expected"),
        (GOOD.replace("pivot: [0", "pivot: [30"), r"pivot: \[30.0, 0.0, 0.0\] is farther than 1 m"),
        (
            GOOD + "pivto: 3\n",
            "pivto: unknown, did you mean pivot. allowed: body, ",
        ),
        (GOOD.replace("heading_deg: 0", "heading_deg: north"), "heading_deg: a number expected"),
        (GOOD.replace("pivot: [0, 0, 0]\n", ""), "pivot is missing"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, wrong, reason):
    file = tmp_path / "wrong.yaml"
    file.write_text(wrong)
    with pytest.raises(MocapError, match=reason) as refused:
        calibrations.load(str(file))
    assert "\n" not in str(refused.value)


def test_a_name_that_does_not_exist_is_answered_with_those_that_do():
    with pytest.raises(ConfigurationError, match="motive_y_up, motive_z_up"):
        calibrations.load("vicon_lab")
