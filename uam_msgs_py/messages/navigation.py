"""The estimate and the plan in nav_msgs, for standard tools."""

from __future__ import annotations

from functools import cache

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.serialization import serialize_message

from uam_control.arm.chain import Chain
from uam_control.arm.hand import hand_in_world
from uam_control.coordinates import ATTITUDE, CHI, CHI_DOT, POSITION
from uam_control.maths.rotations import (
    matrix_from_euler,
    quaternion_from_euler,
    quaternion_from_matrix,
    rotate_back,
)
from uam_control.stamps import SECOND
from uam_msgs_py.messages.layouts import STAMP
from uam_msgs_py.messages.ros_time import set_stamp
from uam_msgs_py.messages.topics import BODY, WORLD


def odometry_message(stamp: int, state: np.ndarray, frame: str = BODY) -> Odometry:
    """Return the state (3, 6 + n) at `stamp` [ns]: pose in the world, twist in the body (FLU).

    frame: name of the body's frame.
    """
    message = Odometry(child_frame_id=frame)
    message.header.frame_id = WORLD
    set_stamp(message.header.stamp, stamp)
    _fill(message.pose.pose, state[CHI])
    to_world = matrix_from_euler(state[CHI, ATTITUDE])
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    linear.x, linear.y, linear.z = rotate_back(to_world, state[CHI_DOT, POSITION].copy()).tolist()
    angular.x, angular.y, angular.z = state[CHI_DOT, ATTITUDE].tolist()
    return message


def hand_message(stamp: int, chain: Chain, chi: np.ndarray) -> PoseStamped:
    """Return the pose of the end effector at `stamp` [ns] for chi (6 + n,), in the world."""
    place, turn = hand_in_world(chain, chi)
    message = PoseStamped()
    message.header.frame_id = WORLD
    set_stamp(message.header.stamp, stamp)
    at, turned = message.pose.position, message.pose.orientation
    at.x, at.y, at.z = place
    turned.w, turned.x, turned.y, turned.z = quaternion_from_matrix(np.array(turn)).tolist()
    return message


def path_message(stamp: int, times: np.ndarray, chi: np.ndarray) -> bytes:
    """Return the serialized path at `stamp` [ns] through chi (m, 6 + n), at its times (m,) [ns]."""
    head, pose = _serialized_path()
    count = len(times)
    header = head.copy()
    header[STAMP].view("<i4")[:] = divmod(stamp, SECOND)
    header[-4:].view("<u4")[:] = count
    poses = np.tile(pose, (count, 1))
    poses[:, :8].view("<i4")[:] = np.column_stack(np.divmod(times, SECOND))
    numbers = poses[:, -56:].view("<f8")
    numbers[:, :3] = chi[:, POSITION]
    for row, turned in zip(numbers, chi[:, ATTITUDE], strict=True):
        row[6], row[3], row[4], row[5] = quaternion_from_euler(turned)
    return header.tobytes() + poses.tobytes()


@cache
def _serialized_path() -> tuple[np.ndarray, np.ndarray]:
    """Return the bytes of a path up to its first pose, and those of a pose.

    All poses have the same bytes apart from their numbers, as all begin at a multiple of 8: at the
    end of a pose there are seven float64.
    """
    message = Path()
    message.header.frame_id = WORLD
    lengths = []
    for _ in range(2):
        pose = PoseStamped()
        pose.header.frame_id = WORLD
        message.poses.append(pose)
        data = np.frombuffer(serialize_message(message), dtype=np.uint8)
        lengths.append(len(data))
    size = lengths[1] - lengths[0]
    return data[: -2 * size], data[-size:]


def _fill(pose: Pose, chi: np.ndarray) -> None:
    """Write position and attitude of chi (6 + n,) into a geometry_msgs/Pose."""
    at, turn = pose.position, pose.orientation
    at.x, at.y, at.z = chi[POSITION].tolist()
    turn.w, turn.x, turn.y, turn.z = quaternion_from_euler(chi[ATTITUDE]).tolist()
