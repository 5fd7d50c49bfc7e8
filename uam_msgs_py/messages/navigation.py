"""The estimate and the plan in nav_msgs, for standard tools."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped
from nav_msgs.msg import Odometry, Path

from uam_control.coordinates import ATTITUDE, CHI, CHI_DOT, POSITION
from uam_control.maths.rotations import matrix_from_euler, quaternion_from_euler, rotate_back
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


def path_message(stamp: int, times: np.ndarray, chi: np.ndarray) -> Path:
    """Return the path at `stamp` [ns] through chi (m, 6 + n), each at its times (m,) [ns]."""
    message = Path()
    message.header.frame_id = WORLD
    set_stamp(message.header.stamp, stamp)
    for time, row in zip(times.tolist(), chi, strict=True):
        pose = PoseStamped()
        pose.header.frame_id = WORLD
        set_stamp(pose.header.stamp, time)
        _fill(pose.pose, row)
        message.poses.append(pose)
    return message


def _fill(pose: Pose, chi: np.ndarray) -> None:
    """Write position and attitude of chi (6 + n,) into a geometry_msgs/Pose."""
    at, turn = pose.position, pose.orientation
    at.x, at.y, at.z = chi[POSITION].tolist()
    turn.w, turn.x, turn.y, turn.z = quaternion_from_euler(chi[ATTITUDE]).tolist()
