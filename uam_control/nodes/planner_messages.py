"""Goals and trajectories of planners: ROS messages → GoalPose and Points."""

import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped

from uam_control.coordinates import ALPHA, ARM, CHI, CHI_DOT, POSITION, YAW
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
    check_frame(message.header.frame_id)
    p, q = message.pose.position, message.pose.orientation
    height = math.nan if p.z == 0.0 else p.z
    return GoalPose(np.array([p.x, p.y, height]), _yaw(q.x, q.y, q.z, q.w))


def read_base_trajectory(data: bytes) -> Points:
    """Return the points of a serialized MultiDOFJointTrajectory of one body; raises BadMessage.

    Velocities and accelerations are optional, in the world frame; angular: only z, the yaw's.
    """
    body = read_body(data, "the vehicle's base")
    points = np.zeros((len(BODY_ROWS), len(body.times), ALPHA))
    points[CHI, :, POSITION] = body.positions
    for i, quaternion in enumerate(body.rotations):
        points[CHI, i, YAW] = yaw = _yaw(*quaternion)
        if math.isnan(yaw):
            raise BadMessage(f"point {i}: the rotation is no quaternion")
    points[CHI_DOT:, :, POSITION] = body.rates[..., :3]
    points[CHI_DOT:, :, YAW] = body.rates[..., 3]
    return Points(body.times, points, BASE)


class Body(NamedTuple):
    """The points of a body."""

    times: np.ndarray  # (m,) [s]
    positions: np.ndarray  # (m, 3) [m]
    rotations: np.ndarray  # (m, 4): x y z w
    rates: np.ndarray  # (2, m, 4): velocities and accelerations of x y z yaw, NaN where not given


def read_body(data: bytes, name: str) -> Body:
    """Return the only body of a MultiDOFJointTrajectory; raises BadMessage with `name`."""
    trajectory = _Trajectory(data)
    check_frame(trajectory.layout.frame)
    if len(trajectory.layout.names) > 1:
        count = len(trajectory.layout.names)
        raise BadMessage(f"{count} joints, 1 expected: {name}")
    times, places = trajectory.empty(7)
    rates = trajectory.empty(4)[1][1:]
    for i in range(len(times)):
        for row, (what, size) in enumerate(BODY_ROWS):
            count = trajectory.count()
            if count > 1 or (row == CHI and count == 0):
                raise BadMessage(f"point {i}: {count} {what}, 1 expected")
            if count == 0:
                continue
            values = trajectory.numbers(size)
            if row == CHI:
                places[CHI, i] = values
                continue
            rates[row - 1, i] = *values[:3], values[-1]
            if not all_finite(rates[row - 1, i]):
                raise BadMessage(f"point {i}: a velocity or acceleration is not finite")
        times[i] = trajectory.time(i)
    return Body(times, places[CHI, :, :3], places[CHI, :, 3:], rates)


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


def check_frame(frame: str) -> None:
    """Raise BadMessage for another frame than the world's."""
    if frame not in ("", WORLD):
        raise BadMessage(f"frame_id '{frame}', '{WORLD}' expected")


def is_given(x: float, y: float, z: float, w: float) -> bool:
    """Return whether there is an orientation: no zeros, no NaN; raises BadMessage for its norm."""
    norm = math.hypot(x, y, z, w)
    if norm == 0.0 or any(map(math.isnan, (x, y, z, w))):
        return False
    if not math.isfinite(norm) or abs(norm - 1.0) > 0.1:
        raise BadMessage(f"the orientation has the norm {norm:g}, 1 expected")
    return True


def _yaw(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw [rad], NaN for an orientation of zeros or NaN; raises BadMessage for tilt."""
    if not is_given(x, y, z, w):
        return math.nan
    norm = math.hypot(x, y, z, w)
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    tilt = math.acos(min(1.0, max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
    if tilt > LEVEL:
        raise BadMessage(f"the orientation is tilted by {tilt:.2f} rad, {LEVEL:g} rad allowed")
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
