"""numpy ↔ ROS messages, without copies that cost time at 250 Hz.

Writers own one message and NumPy views into its arrays: filling one is a few assignments, and the
message is published again and again. Readers check names, lengths, frames and numbers, and raise
BadMessage with one line. This is the only place where quaternions change between [w x y z] (maths)
and x, y, z, w (ROS). Stamps are integer nanoseconds.
"""

import math
from array import array
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

WORLD = "world"  # frame of poses and states, ENU
BODY = "base_link"  # frame of rates, forces and torques, FLU
SECOND = 1_000_000_000


class BadMessage(ValueError):
    """A message that must not be used; the text is one line: what was wrong, what is expected."""


def stamp_of(stamp) -> int:
    """builtin_interfaces/Time → integer nanoseconds."""
    return stamp.sec * SECOND + stamp.nanosec


def set_stamp(stamp, nanoseconds: int) -> None:
    """Integer nanoseconds → builtin_interfaces/Time, in place."""
    stamp.sec, stamp.nanosec = divmod(nanoseconds, SECOND)


def seconds(nanoseconds: int) -> float:
    """Nanoseconds [ns] → the maths' seconds [s]."""
    return nanoseconds / SECOND


def view(message, field: str, size: int) -> np.ndarray:
    """Give a message's float64[] field `size` zeros and return the NumPy view that fills it."""
    setattr(message, field, array("d", bytes(8 * size)))
    return np.frombuffer(getattr(message, field))  # the message may have copied what it was given


class TrajectoryWriter:
    """A JointTrajectory with one point: rows positions, velocities, accelerations, effort.

    `values` holds a view (n,) for each row in use; write to them and publish `stamped(stamp)`.
    """

    ROWS = ("positions", "velocities", "accelerations", "effort")

    def __init__(self, names: Sequence[str], rows: Sequence[str] = ROWS[:3]):
        """names: of the n joints; rows: those of ROWS that are used."""
        point = JointTrajectoryPoint()
        self.message = JointTrajectory(joint_names=list(names), points=[point])
        self.message.header.frame_id = WORLD
        self.values = {row: view(point, row, len(names)) for row in rows}
        self._stamp = self.message.header.stamp
        self._time = point.time_from_start

    def stamped(self, stamp: int, time_from_start: int = 0) -> JointTrajectory:
        """Return the message with this stamp [ns]; time_from_start [ns]."""
        set_stamp(self._stamp, stamp)
        set_stamp(self._time, time_from_start)
        return self.message

    def fill(self, stamp: int, state: np.ndarray, time_from_start: int = 0) -> JointTrajectory:
        """Return the message with state (3, n): positions, velocities, accelerations."""
        values = self.values
        values["positions"][:] = state[0]
        values["velocities"][:] = state[1]
        values["accelerations"][:] = state[2]
        return self.stamped(stamp, time_from_start)


def idle_trajectory() -> JointTrajectory:
    """Return a JointTrajectory without names and points: nothing is commanded at its stamp."""
    message = JointTrajectory()
    message.header.frame_id = WORLD
    return message


def read_trajectory(
    message: JointTrajectory, names: Sequence[str], rows: Sequence[str], out: np.ndarray
) -> None:
    """Copy the first point's `rows` into out (len(rows), len(names)).

    Raises BadMessage on other joint names, wrong lengths, no point, or a number that is not finite.
    """
    if message.joint_names != names:
        check_names(message.joint_names, names)
    if len(message.points) != 1:
        raise BadMessage(f"{len(message.points)} points, 1 expected")
    point = message.points[0]
    for i, row in enumerate(rows):
        _copy(row, getattr(point, row), names, out[i])


def check_names(given: Sequence[str], expected: Sequence[str]) -> None:
    """Raise BadMessage unless `given` are exactly the expected joint names, in order."""
    if list(given) != list(expected):
        raise BadMessage(
            f"joint names {', '.join(given) or '(none)'}; expected {', '.join(expected)}"
        )


def _copy(what: str, values: array, names: Sequence[str], out: np.ndarray) -> None:
    if len(values) != len(out):
        raise BadMessage(f"{len(values)} {what}, {len(out)} expected ({', '.join(names)})")
    out[:] = values
    if not math.isfinite(out.sum()):
        for name, value in zip(names, values, strict=True):
            if not math.isfinite(value):
                raise BadMessage(f"{what} of {name} is {value}")
        raise BadMessage(f"{what} overflow")


class JointStateWriter:
    """A JointState whose views position, velocity, effort (n,) are written and published."""

    def __init__(self, names: Sequence[str]):
        """names: of the n joints."""
        self.message = JointState(name=list(names))
        self.position = view(self.message, "position", len(names))
        self.velocity = view(self.message, "velocity", len(names))
        self.effort = view(self.message, "effort", len(names))

    def stamped(self, stamp: int) -> JointState:
        """Return the message with this stamp [ns]."""
        set_stamp(self.message.header.stamp, stamp)
        return self.message


def read_joints(message: JointState, names: Sequence[str]) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], position (n,) [rad], velocity (n,) [rad/s]) in the order of `names`.

    The message may hold further joints, in any order, as /joint_states does on robots. Raises
    BadMessage where one of `names` or a number is missing or not finite.
    """
    position, velocity = np.empty(len(names)), np.empty(len(names))
    order = list(message.name)
    for what, source, out in (
        ("positions", message.position, position),
        ("velocities", message.velocity, velocity),
    ):
        if len(source) != len(order):
            raise BadMessage(f"{len(source)} {what} for {len(order)} joints")
        if order != names:
            try:
                source = array("d", (source[order.index(name)] for name in names))
            except ValueError:
                check_names(order, names)
        _copy(what, source, names, out)
    return stamp_of(message.header.stamp), position, velocity


class ImuWriter:
    """An Imu without orientation (orientation_covariance[0] = -1)."""

    def __init__(self):
        self.message = Imu()
        self.message.header.frame_id = BODY
        self.message.orientation_covariance[0] = -1.0

    def fill(self, stamp: int, gyro: np.ndarray, specific_force: np.ndarray) -> Imu:
        """Return the message; gyro (3,) [rad/s], specific_force (3,) [m/s^2], FLU."""
        set_vector(self.message.angular_velocity, gyro)
        set_vector(self.message.linear_acceleration, specific_force)
        set_stamp(self.message.header.stamp, stamp)
        return self.message


def read_imu(message: Imu) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], gyro (3,) [rad/s], specific force (3,) [m/s^2]), FLU."""
    return (
        stamp_of(message.header.stamp),
        vector("angular_velocity", message.angular_velocity),
        vector("linear_acceleration", message.linear_acceleration),
    )


class PoseWriter:
    """A PoseStamped in the world frame."""

    def __init__(self):
        self.message = PoseStamped()
        self.message.header.frame_id = WORLD

    def fill(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> PoseStamped:
        """Return the message; position (3,) [m], quaternion [w x y z] body → world."""
        set_vector(self.message.pose.position, position)
        set_quaternion(self.message.pose.orientation, quaternion)
        set_stamp(self.message.header.stamp, stamp)
        return self.message


def read_pose(message: PoseStamped, frame: str = WORLD) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], position (3,) [m], quaternion [w x y z], normalised).

    Raises BadMessage for another frame, or numbers that are not finite or not a rotation.
    """
    if message.header.frame_id != frame:
        raise BadMessage(f"frame '{message.header.frame_id}', expected '{frame}'")
    return (
        stamp_of(message.header.stamp),
        vector("position", message.pose.position),
        quaternion_of(message.pose.orientation),
    )


class EffortWriter:
    """A Float64MultiArray of the ros2_control effort controllers; write to `values` (n,)."""

    def __init__(self, count: int):
        self.message = Float64MultiArray()
        self.values = view(self.message, "data", count)


def read_effort(message: Float64MultiArray, names: Sequence[str]) -> np.ndarray:
    """Return the efforts (n,) [N m]; raises BadMessage on a wrong number of joints or a NaN."""
    out = np.empty(len(names))
    _copy("efforts", message.data, names, out)
    return out


class SetpointWriter:
    """The TwistStamped that repeats what was sent to the autopilot."""

    def __init__(self):
        self.message = TwistStamped()
        self.message.header.frame_id = BODY

    def fill(self, stamp: int, rates: np.ndarray, thrust: float) -> TwistStamped:
        """Return the message; rates (3,) [rad/s, FLU], thrust 0..1."""
        set_vector(self.message.twist.angular, rates)
        self.message.twist.linear.z = float(thrust)
        set_stamp(self.message.header.stamp, stamp)
        return self.message


def read_setpoint(message: TwistStamped) -> tuple[int, np.ndarray, float]:
    """Return (stamp [ns], body rates (3,) [rad/s, FLU], thrust 0..1)."""
    rates = vector("angular", message.twist.angular)
    return stamp_of(message.header.stamp), rates, message.twist.linear.z


def set_vector(message, values: np.ndarray) -> None:
    """(3,) → Vector3 or Point, in place."""
    message.x, message.y, message.z = float(values[0]), float(values[1]), float(values[2])


def vector(name: str, message) -> np.ndarray:
    """Vector3 or Point → (3,); raises BadMessage where a number is not finite."""
    values = np.array((message.x, message.y, message.z))
    if not math.isfinite(message.x + message.y + message.z):
        raise BadMessage(f"{name} is {values.tolist()}, finite numbers expected")
    return values


def set_quaternion(message, quaternion: np.ndarray) -> None:
    """[w x y z] → Quaternion, in place."""
    w, x, y, z = quaternion
    message.w, message.x, message.y, message.z = float(w), float(x), float(y), float(z)


def quaternion_of(message) -> np.ndarray:
    """Quaternion → [w x y z], normalised; raises BadMessage unless its norm is 1 within 1 %."""
    values = np.array((message.w, message.x, message.y, message.z))
    norm = math.sqrt(values @ values)
    if not abs(norm - 1.0) < 0.01:
        raise BadMessage(f"orientation has norm {norm:.3g}, 1 expected")
    return values if abs(norm - 1.0) < 1e-12 else values / norm  # rounding errors may stay
