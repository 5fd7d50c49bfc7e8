"""Paths and odometry in nav_msgs."""

import numpy as np
import pytest
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message

from uam_control.maths.rotations import quaternion_from_euler
from uam_control.vehicle import chain_of, load_description
from uam_msgs_py.messages.navigation import hand_message, path_message


@pytest.mark.parametrize("count", [0, 1, 3, 1000])
def test_a_path_has_every_pose_with_its_time(count):
    generator = np.random.default_rng(count)
    chi, times = generator.normal(size=(count, 8)), np.arange(count) * 250_000_000 + 7_123_456_789
    path = deserialize_message(path_message(12_000_000_034, times, chi), Path)
    assert (path.header.frame_id, path.header.stamp.sec, path.header.stamp.nanosec) == (
        *("world", 12, 34),
    )
    assert len(path.poses) == count
    for pose, time, row in zip(path.poses, times.tolist(), chi, strict=True):
        stamp, at, turn = pose.header.stamp, pose.pose.position, pose.pose.orientation
        assert pose.header.frame_id == "world"
        assert stamp.sec * 1_000_000_000 + stamp.nanosec == time
        assert [at.x, at.y, at.z] == row[:3].tolist()
        assert [turn.w, turn.x, turn.y, turn.z] == quaternion_from_euler(row[3:6]).tolist()


def test_two_paths_do_not_share_their_bytes():
    first = path_message(1, np.array([5]), np.ones((1, 8)))
    path_message(2, np.array([6]), np.zeros((1, 8)))
    assert deserialize_message(first, Path).poses[0].pose.position.x == 1.0


def test_the_pose_of_the_end_effector():
    chi = np.array([1.0, 2.0, 3.0, 0.0, 0.0, np.pi / 2, 0.0, np.pi / 2])
    message = hand_message(12_000_000_034, chain_of(load_description()), chi)
    assert message.header.frame_id == "world"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (12, 34)
    at, turn = message.pose.position, message.pose.orientation
    # 0.14 m to the vehicle's front, its left of the world; the magnet's face hangs level
    assert [at.x, at.y, at.z] == pytest.approx([1.0, 2.14, 3.0 - 0.073 - 0.1 - 0.03])
    half = np.sqrt(0.5)
    assert [turn.w, turn.x, turn.y, turn.z] == pytest.approx([half, 0.0, 0.0, half])
