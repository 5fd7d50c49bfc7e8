"""The estimate and the plan in nav_msgs, for standard tools."""

import math
from collections.abc import Sequence
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
from uam_msgs_py.messages.layouts import STAMP, BadMessage
from uam_msgs_py.messages.ros_time import nanoseconds, set_stamp
from uam_msgs_py.messages.topics import BODY, WORLD

FRAMES = (WORLD, "map", "odom")  # of an odometry that is read, REP 105
# m, rad: a pose whose covariance says more is of an odometry that has lost its way
LARGEST_DEVIATION = 0.25


def odometry_message(stamp: int, state: np.ndarray, frame: str = BODY) -> Odometry:
    """Return the state (3, 6 + n) at `stamp` [ns]: pose in the world, twist in the body (FLU)."""
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
    message = _pose_message(place, quaternion_from_matrix(np.array(turn)))
    set_stamp(message.header.stamp, stamp)
    return message


def goal_message(place: Sequence[float], yaw: float = math.nan) -> PoseStamped:
    """Return a goal pose: place (3,) [m, ENU]; yaw [rad], NaN: the present heading stays."""
    along = 0.0, 0.0  # zeros: no orientation
    if not math.isnan(yaw):
        along = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    return _pose_message(place, (along[0], 0.0, 0.0, along[1]))


def _pose_message(place: Sequence[float], quaternion: Sequence[float]) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = WORLD
    at, turn = message.pose.position, message.pose.orientation
    at.x, at.y, at.z = map(float, place)
    turn.w, turn.x, turn.y, turn.z = map(float, quaternion)
    return message


class OdometryWriter:
    """Writes the poses of an odometry, without twist and covariance."""

    def __init__(self, frame: str = BODY):
        """frame: of the body."""
        self._message = Odometry(child_frame_id=frame)
        self._message.header.frame_id = "odom"

    def fill(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> bytes:
        """Return the message; position (3,) [m], quaternion (4,) body → its frame [w x y z]."""
        set_stamp(self._message.header.stamp, stamp)
        at, turn = self._message.pose.pose.position, self._message.pose.pose.orientation
        at.x, at.y, at.z = position.tolist()
        turn.w, turn.x, turn.y, turn.z = quaternion.tolist()
        return serialize_message(self._message)


def read_odometry(message: Odometry, frame: str = BODY) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], position (3,) [m], unit quaternion (4,) body → its frame [w x y z]).

    frame: of the body. The twist is not used. Raises BadMessage for another frame, numbers that are
    not finite, a quaternion whose norm is not 1, or a deviation above LARGEST_DEVIATION; a variance
    that is not finite and positive is unknown.
    """
    found, child = message.header.frame_id, message.child_frame_id
    if found not in FRAMES:
        raise BadMessage(f"frame '{found}', expected {', '.join(FRAMES)}")
    if child not in (frame, BODY):
        raise BadMessage(f"child_frame_id '{child}', expected '{frame}'")
    at, turn = message.pose.pose.position, message.pose.pose.orientation
    position = np.array([at.x, at.y, at.z])
    quaternion = np.array([turn.w, turn.x, turn.y, turn.z])
    if not np.isfinite(position).all():
        raise BadMessage(f"position {position.tolist()} is not finite")
    norm = math.sqrt(quaternion @ quaternion)
    if not abs(norm - 1.0) < 0.01:
        raise BadMessage(f"orientation has norm {norm:.3g}, 1 expected")
    variances = np.asarray(message.pose.covariance)[::7]
    known = variances[np.isfinite(variances) & (variances > 0.0)]
    if known.size and (deviation := math.sqrt(known.max())) > LARGEST_DEVIATION:
        allowed = f"at most {LARGEST_DEVIATION} is used"
        raise BadMessage(f"covariance: deviation {deviation:.3g} m or rad, {allowed}")
    return nanoseconds(message.header.stamp), position, quaternion / norm


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
