"""Goals and trajectories of planners: ROS messages → GoalPose and Points."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped, Quaternion
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from uam_control.coordinates import ALPHA, ARM, CHI, CHI_DDOT, CHI_DOT, POSITION, YAW
from uam_control.mission.plans import BASE, GoalPose, Points
from uam_control.stamps import SECOND
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.topics import WORLD

LEVEL = 0.05  # [rad] largest tilt of a goal: the position law itself sets the attitude


def read_goal(data: bytes) -> GoalPose:
    """Return the goal of a serialized PoseStamped; raises BadMessage.

    A height of exactly 0 keeps the height: RViz's 2D goal tool sends it. An orientation of zeros or
    NaN keeps the heading.
    """
    message = deserialize_message(data, PoseStamped)
    _check_frame(message.header.frame_id)
    p = message.pose.position
    height = math.nan if p.z == 0.0 else p.z
    return GoalPose(np.array([p.x, p.y, height]), _yaw(message.pose.orientation))


def read_base_trajectory(message: MultiDOFJointTrajectory) -> Points:
    """Return the points of a trajectory of one body; raises BadMessage.

    Velocities and accelerations are optional, in the world frame; angular: only z, the yaw's.
    """
    _check_frame(message.header.frame_id)
    if len(message.joint_names) > 1:
        raise BadMessage(f"{len(message.joint_names)} joints, 1 expected: the vehicle's base")
    count = len(message.points)
    times, points = np.zeros(count), np.full((3, count, ALPHA), np.nan)
    for i, point in enumerate(message.points):
        if len(point.transforms) != 1:
            raise BadMessage(f"point {i}: {len(point.transforms)} transforms, 1 expected")
        times[i] = _seconds(point.time_from_start)
        points[:, i, ALPHA - 3 :] = 0.0
        at, turn = point.transforms[0].translation, point.transforms[0].rotation
        yaw = _yaw(turn)
        if math.isnan(yaw):
            raise BadMessage(f"point {i}: the rotation is no quaternion")
        points[CHI, i, POSITION], points[CHI, i, YAW] = (at.x, at.y, at.z), yaw
        for row, twists in ((CHI_DOT, point.velocities), (CHI_DDOT, point.accelerations)):
            if len(twists) > 1:
                raise BadMessage(f"point {i}: {len(twists)} twists, 1 expected")
            if not twists:
                points[row, i] = np.nan
                continue
            linear = twists[0].linear
            points[row, i, POSITION] = linear.x, linear.y, linear.z
            points[row, i, YAW] = twists[0].angular.z
            if not np.isfinite(points[row, i]).all():
                raise BadMessage(f"point {i}: a velocity or acceleration is not finite")
    return Points(times, points, BASE)


def read_arm_trajectory(data: bytes, joints: Sequence[str]) -> Points:
    """Return the points of a serialized JointTrajectory of all `joints`; raises BadMessage.

    The joints may be in any order; velocities and accelerations are optional.
    """
    message = deserialize_message(data, JointTrajectory)
    names = list(message.joint_names)
    if sorted(names) != sorted(joints):
        raise BadMessage(f"joints {', '.join(names) or 'none'}; expected: {', '.join(joints)}")
    order = [names.index(name) for name in joints]
    count = len(message.points)
    times, points = np.zeros(count), np.full((3, count, len(joints)), np.nan)
    for i, point in enumerate(message.points):
        times[i] = _seconds(point.time_from_start)
        rows = ("positions", "velocities", "accelerations")
        for row, name in enumerate(rows):
            values = np.array(getattr(point, name), dtype=float)
            if row != CHI and len(values) == 0:
                continue
            if len(values) != len(joints):
                raise BadMessage(f"point {i}: {len(values)} {name}, {len(joints)} expected")
            if not np.isfinite(values).all():
                raise BadMessage(f"point {i}: {name} are not finite")
            points[row, i] = values[order]
    return Points(times, points, ARM)


def _check_frame(frame: str) -> None:
    if frame not in ("", WORLD):
        raise BadMessage(f"frame_id '{frame}', '{WORLD}' expected")


def _seconds(time: Duration) -> float:
    return time.sec + time.nanosec / SECOND


def _yaw(turn: Quaternion) -> float:
    """Return the yaw [rad], NaN for an orientation of zeros or NaN; raises BadMessage for tilt."""
    q = np.array([turn.w, turn.x, turn.y, turn.z])
    norm = float(np.linalg.norm(q))
    if norm == 0.0 or np.isnan(q).any():
        return math.nan
    w, x, y, z = q / norm
    if not math.isfinite(norm) or abs(norm - 1.0) > 0.1:
        raise BadMessage(f"the orientation has the norm {norm:g}, 1 expected")
    tilt = math.acos(min(1.0, max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
    if tilt > LEVEL:
        raise BadMessage(f"the orientation is tilted by {tilt:.2f} rad, {LEVEL:g} rad allowed")
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
