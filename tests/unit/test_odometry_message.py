"""Odometry messages: what is read, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.navigation import OdometryWriter, read_odometry


def message(frame="odom", child="base_link", position=(1.0, 2.0, 3.0), w=0.8, variance=0.0):
    made = Odometry(child_frame_id=child)
    made.header.frame_id, made.header.stamp.sec, made.header.stamp.nanosec = frame, 2, 5
    made.pose.pose.position.x, made.pose.pose.position.y, made.pose.pose.position.z = position
    made.pose.pose.orientation.w, made.pose.pose.orientation.z = w, 0.6
    made.pose.covariance[7] = variance
    return made


@pytest.mark.parametrize("frame", ["world", "map", "odom"])
@pytest.mark.parametrize("variance", [0.0, -1.0, 0.06, math.nan, math.inf])
def test_a_pose_is_read(frame, variance):
    stamp, position, quaternion = read_odometry(message(frame, variance=variance))
    assert stamp == 2_000_000_005
    np.testing.assert_array_equal(position, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(quaternion, [0.8, 0.0, 0.0, 0.6])


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"frame": "camera"}, "frame 'camera', expected world, map, odom"),
        ({"frame": ""}, "frame '', expected world, map, odom"),
        ({"child": "camera"}, "child_frame_id 'camera', expected 'uav1/base_link'"),
        ({"position": (1.0, math.nan, 0.0)}, r"position \[1.0, nan, 0.0\] is not finite"),
        ({"w": 0.9}, "orientation has norm 1.08, 1 expected"),
        ({"w": math.nan}, "orientation has norm nan, 1 expected"),
        ({"variance": 0.09}, "covariance: deviation 0.3 m or rad, at most 0.25 is used"),
    ],
)
def test_a_pose_is_refused(given, text):
    with pytest.raises(BadMessage, match=text):
        read_odometry(message(**given), "uav1/base_link")


def test_what_is_written_is_read():
    writer = OdometryWriter("uav1/base_link")
    data = writer.fill(3_000_000_007, np.array([0.5, -1.0, 2.0]), np.array([0.6, 0.0, 0.8, 0.0]))
    stamp, *pose = read_odometry(deserialize_message(data, Odometry), "uav1/base_link")
    assert stamp == 3_000_000_007
    np.testing.assert_array_equal(np.concatenate(pose), [0.5, -1.0, 2.0, 0.6, 0.0, 0.8, 0.0])
