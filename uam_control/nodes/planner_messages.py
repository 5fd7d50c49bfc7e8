"""Goals and trajectories of planners: ROS messages → GoalPose and Points."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped

from uam_control.coordinates import ALPHA, ARM, CHI, POSITION, YAW
from uam_control.mission.plans import BASE, MOST_POINTS, GoalPose, Points
from uam_control.stamps import SECOND
from uam_msgs_py.messages.layouts import BadMessage, Cursor, is_little_endian
from uam_msgs_py.messages.serialized import all_finite, deserialized
from uam_msgs_py.messages.topics import WORLD

LEVEL = 0.05  # [rad] largest tilt of a goal: the position law itself sets the attitude
LONGEST = 1_000_000  # [s] of a time_from_start
# of a base's point: name and numbers of a transform, velocity, acceleration
BODY_ROWS = (("transforms", 7), ("twists", 6), ("twists", 6))
_DURATION = struct.Struct("<iI")


def read_goal(data: bytes) -> GoalPose:
    """Return the goal of a serialized PoseStamped; raises BadMessage.

    A height of exactly 0 keeps the height: RViz's 2D goal tool sends it. An orientation of zeros or
    NaN keeps the heading.
    """
    message = deserialized(data, PoseStamped)
    _check_frame(message.header.frame_id)
    p, q = message.pose.position, message.pose.orientation
    height = math.nan if p.z == 0.0 else p.z
    return GoalPose(np.array([p.x, p.y, height]), _yaw(q.x, q.y, q.z, q.w))


def read_base_trajectory(data: bytes) -> Points:
    """Return the points of a serialized MultiDOFJointTrajectory of one body; raises BadMessage.

    Velocities and accelerations are optional, in the world frame; angular: only z, the yaw's.
    """
    trajectory = _Trajectory(data)
    _check_frame(trajectory.layout.frame)
    if len(trajectory.layout.names) > 1:
        count = len(trajectory.layout.names)
        raise BadMessage(f"{count} joints, 1 expected: the vehicle's base")
    times, points = trajectory.empty(ALPHA)
    for i in range(len(times)):
        points[:, i, ALPHA - 3 :] = 0.0
        for row, (what, size) in enumerate(BODY_ROWS):
            count = trajectory.count()
            if count > 1 or (row == CHI and count == 0):
                raise BadMessage(f"point {i}: {count} {what}, 1 expected")
            if count == 0:
                points[row, i] = np.nan
                continue
            values = trajectory.numbers(size)
            points[row, i, POSITION] = values[:3]
            if row == CHI:
                points[row, i, YAW] = yaw = _yaw(*values[3:])
                if math.isnan(yaw):
                    raise BadMessage(f"point {i}: the rotation is no quaternion")
                continue
            points[row, i, YAW] = values[-1]
            if not all_finite(points[row, i]):
                raise BadMessage(f"point {i}: a velocity or acceleration is not finite")
        times[i] = trajectory.time(i)
    return Points(times, points, BASE)


def read_arm_trajectory(data: bytes, joints: Sequence[str]) -> Points:
    """Return the points of a serialized JointTrajectory of all `joints`; raises BadMessage.

    The joints may be in any order; velocities and accelerations are optional.
    """
    trajectory = _Trajectory(data)
    names = trajectory.layout.names
    if sorted(names) != sorted(joints):
        raise BadMessage(f"joints {', '.join(names) or 'none'}; expected: {', '.join(joints)}")
    order = [names.index(name) for name in joints]
    times, points = trajectory.empty(len(joints))
    for i in range(len(times)):
        for row, name in enumerate(("positions", "velocities", "accelerations")):
            count = trajectory.count()
            if row != CHI and count == 0:
                continue
            if count != len(joints):
                raise BadMessage(f"point {i}: {count} {name}, {len(joints)} expected")
            values = trajectory.numbers(count)
            if not all_finite(values):
                raise BadMessage(f"point {i}: {name} are not finite")
            points[row, i] = values[order]
        if count := trajectory.count():
            trajectory.numbers(count)  # effort
        times[i] = trajectory.time(i)
    return Points(times, points, ARM)


class _Trajectory(Cursor):
    """A serialized trajectory, at its first point. Raises BadMessage, also for too many points.

    ROS's own classes would be made for all points before their number could be refused.
    """

    def __init__(self, data: bytes):
        super().__init__(data)
        if not is_little_endian(data):
            raise BadMessage("not little-endian")
        self.header()
        self.names()
        self._points = self.count()
        if self._points > MOST_POINTS:
            raise BadMessage(f"{self._points} points, at most {MOST_POINTS} allowed")

    def empty(self, size: int) -> tuple[np.ndarray, np.ndarray]:
        """Return room for times (m,) and points (3, m, size), these NaN."""
        return np.zeros(self._points), np.full((3, self._points, size), np.nan)

    def numbers(self, count: int) -> np.ndarray:
        """Read float64 (count,)."""
        return np.frombuffer(self.data, "<f8", count, self.forward(8 * count, align=8).start)

    def time(self, point: int) -> float:
        """Read the time_from_start [s] of a point."""
        seconds, nanoseconds = _DURATION.unpack_from(self.data, self.stamp().start)
        if nanoseconds >= SECOND or seconds > LONGEST:
            raise BadMessage(
                f"point {point}: time_from_start is {seconds} s and {nanoseconds} ns, "
                f"at most {LONGEST} s and less than {SECOND} ns allowed"
            )
        return seconds + nanoseconds / SECOND


def _check_frame(frame: str) -> None:
    if frame not in ("", WORLD):
        raise BadMessage(f"frame_id '{frame}', '{WORLD}' expected")


def _yaw(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw [rad], NaN for an orientation of zeros or NaN; raises BadMessage for tilt."""
    norm = math.hypot(x, y, z, w)
    if norm == 0.0 or any(map(math.isnan, (x, y, z, w))):
        return math.nan
    if not math.isfinite(norm) or abs(norm - 1.0) > 0.1:
        raise BadMessage(f"the orientation has the norm {norm:g}, 1 expected")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    tilt = math.acos(min(1.0, max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
    if tilt > LEVEL:
        raise BadMessage(f"the orientation is tilted by {tilt:.2f} rad, {LEVEL:g} rad allowed")
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
