"""Trajectories of planners: read from the serialized messages, refused before they take long."""

import math
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import Transform, Twist
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from uam_control.mission.plans import MOST_POINTS
from uam_control.nodes.planner_messages import read_arm_trajectory, read_base_trajectory
from uam_msgs_py.messages.layouts import BadMessage

JOINTS = ["alpha_1", "alpha_2"]


def arm(*points, names=JOINTS):
    message = JointTrajectory(joint_names=list(names))
    for k, rows in enumerate(points):
        point = JointTrajectoryPoint(**rows)
        point.time_from_start.sec, point.time_from_start.nanosec = k, 500_000_000
        message.points.append(point)
    return message


def read_arm(message):
    return read_arm_trajectory(serialize_message(message), JOINTS)


def body(count=1, twists=1):
    message = MultiDOFJointTrajectory(joint_names=["base_link"])
    message.header.frame_id = "world"
    for k in range(count):
        pose, speed, acceleration = Transform(), Twist(), Twist()
        pose.translation.x, pose.translation.y, pose.translation.z = 1.0 + k, 2.0, 3.0
        pose.rotation.w, pose.rotation.z = math.cos(0.2), math.sin(0.2)
        speed.linear.y, speed.angular.z = 0.5, 0.25
        acceleration.linear.z, acceleration.angular.x = -0.5, 9.0
        point = MultiDOFJointTrajectoryPoint(transforms=[pose])
        point.velocities, point.accelerations = [speed] * twists, [acceleration] * twists
        point.time_from_start.sec = k
        message.points.append(point)
    return message


def read_body(message):
    return read_base_trajectory(serialize_message(message))


def test_rows_of_an_arm_are_read_in_the_order_of_the_joints():
    whole = {"positions": [1.0, 2.0], "velocities": [3.0, 4.0], "accelerations": [5.0, 6.0]}
    rows = ({"positions": [7.0, 8.0]}, whole, {**whole, "effort": [9.0]})
    found = read_arm(arm(*rows, names=JOINTS[::-1]))
    assert found.times.tolist() == [0.5, 1.5, 2.5]
    assert found.points[0].tolist() == [[8.0, 7.0], [2.0, 1.0], [2.0, 1.0]]
    assert np.isnan(found.points[1:, 0]).all()
    assert found.points[1:, 1:].tolist() == [[[4.0, 3.0]] * 2, [[6.0, 5.0]] * 2]


@pytest.mark.parametrize("twists", [0, 1])
def test_rows_of_a_base_are_read(twists):
    found = read_body(body(2, twists))
    assert found.times.tolist() == [0.0, 1.0]
    rows = found.points[:, :, [0, 1, 2, 5]]
    np.testing.assert_allclose(rows[0], [[1.0, 2.0, 3.0, 0.4], [2.0, 2.0, 3.0, 0.4]])
    expected = [[0.0, 0.5, 0.0, 0.25], [0.0, 0.0, -0.5, 0.0]] if twists else np.nan
    for k in range(2):
        np.testing.assert_array_equal(rows[1:, k], np.broadcast_to(expected, (2, 4)))


def test_what_is_incomplete_is_refused():
    assert len(read_body(body(0)).times) == 0  # refused by its check
    two = body()
    two.points[0].transforms *= 2
    for message, text in ((two, "2 transforms"), (body(twists=2), "2 twists")):
        with pytest.raises(BadMessage, match=f"point 0: {text}, 1 expected"):
            read_body(message)
    with pytest.raises(BadMessage, match="1 positions, 2 expected"):
        read_arm(arm({"positions": [0.0]}))
    with pytest.raises(BadMessage, match="velocities are not finite"):
        read_arm(arm({"positions": [0.0, 0.0], "velocities": [0.0, math.inf]}))
    with pytest.raises(BadMessage, match="truncated"):
        read_base_trajectory(serialize_message(body())[:-16])


@pytest.mark.parametrize("seconds, nanoseconds", [(0, 10**9), (0, 4 * 10**9), (1_000_001, 0)])
def test_a_time_that_is_none_is_refused(seconds, nanoseconds):
    base, joints = body(), arm({"positions": [0.0, 0.0]})
    for message, read in ((base, read_body), (joints, read_arm)):
        time_from_start = message.points[0].time_from_start
        time_from_start.sec, time_from_start.nanosec = seconds, nanoseconds
        with pytest.raises(BadMessage, match="point 0: time_from_start"):
            read(message)


def test_too_many_points_are_refused_before_they_are_read():
    base = body()
    base.points *= 20_000
    joints = arm({"positions": [0.0, 0.0]})
    joints.points *= 20_000
    for message, read in (
        (serialize_message(base), read_base_trajectory),
        (serialize_message(joints), lambda data: read_arm_trajectory(data, JOINTS)),
    ):
        begun = time.process_time()
        with pytest.raises(BadMessage, match=f"20000 points, at most {MOST_POINTS} allowed"):
            read(message)
        assert time.process_time() - begun < 0.01
    with pytest.raises(BadMessage, match="100000 names"):
        read_arm(JointTrajectory(joint_names=[""] * 100_000))
