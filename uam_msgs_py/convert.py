"""numpy ↔ serialized ROS messages, with what costs time at 250 Hz left out.

Writers serialize one message when they are made; afterwards only numbers and stamp are put into its
bytes, which are what is published. Readers take serialized messages (raw subscriptions), look up
where the numbers lie, check names, lengths, frames and numbers, and raise BadMessage with one line.
This is the only place where quaternions change between [w x y z] (maths) and x, y, z, w (ROS).
Stamps are integer nanoseconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from uam_msgs_py.layouts import (
    ENCAPSULATION,
    SECOND,
    STAMP,
    BadMessage,
    Layout,
    Layouts,
    is_little_endian,
    stamp_of,
)

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time

WORLD = "world"  # frame of poses and states, ENU
BODY = "base_link"  # frame of rates, forces and torques, FLU


def type_name(message_type: type) -> str:
    """`package/msg/Name` of a generated message class."""
    return f"{message_type.__module__.split('.')[0]}/msg/{message_type.__name__}"


KINDS = (JointTrajectory, JointState, Imu, PoseStamped, TwistStamped, Float64MultiArray, Clock)
LAYOUTS = {kind: Layouts(type_name(kind)) for kind in KINDS}
SWITCH = {on: serialize_message(Bool(data=on)) for on in (False, True)}


def stays_serialized(message_type: type) -> bool:
    """Whether messages of this type are read and written here, serialized."""
    return message_type in LAYOUTS


def set_stamp(stamp: Time, nanoseconds: int) -> None:
    """Integer nanoseconds → builtin_interfaces/Time, in place."""
    stamp.sec, stamp.nanosec = divmod(nanoseconds, SECOND)


def nanoseconds(stamp: Time) -> int:
    """builtin_interfaces/Time → integer nanoseconds."""
    return stamp.sec * SECOND + stamp.nanosec


def seconds(nanoseconds: int) -> float:
    """Nanoseconds [ns] → the maths' seconds [s]."""
    return nanoseconds / SECOND


class Template:
    """A serialized message; `values` holds a view for each of its fields of numbers."""

    def __init__(
        self,
        message: JointTrajectory
        | JointState
        | Imu
        | PoseStamped
        | TwistStamped
        | Float64MultiArray
        | Clock,
    ):
        """message: of a type in LAYOUTS, with its names and with arrays as long as they will be."""
        data = serialize_message(message)
        layout = LAYOUTS[type(message)].of(data)
        # Numbers are aligned from the end of the encapsulation: let that be aligned in memory.
        self._bytes = np.zeros(4 + len(data), dtype=np.uint8)[4:]
        self._bytes[:] = np.frombuffer(data, dtype=np.uint8)
        self.values = {
            name: self._bytes[where].view("<f8") for name, where in layout.fields.items()
        }
        self._stamp = self._time(STAMP)
        self._duration = None if layout.duration is None else self._time(layout.duration)

    def _time(self, where: slice) -> np.ndarray:
        return self._bytes[where].view("<i4")  # seconds; nanoseconds fit an int32 as well

    def stamped(self, stamp: int, time_from_start: int = 0) -> bytes:
        """Return the message with this stamp [ns]; time_from_start [ns], of trajectories only."""
        self._stamp[:] = divmod(stamp, SECOND)
        if self._duration is not None:
            self._duration[:] = divmod(time_from_start, SECOND)
        return self._bytes.tobytes()

    def plain(self) -> bytes:
        """Return the message, of a type that has no stamp."""
        return self._bytes.tobytes()


class Serialized:
    """A received message: its bytes and their layout."""

    def __init__(self, kind: type, data: bytes):
        """kind: a type in LAYOUTS. Raises BadMessage."""
        if not is_little_endian(data):
            data = _here(kind, data)
        self.data = data
        self.layout: Layout = LAYOUTS[kind].of(data)

    @property
    def stamp(self) -> int:
        """Its stamp [ns]."""
        return stamp_of(self.data)

    def numbers(self, field: str) -> np.ndarray:
        """A read-only view (n,) of a field of numbers, (0,) where it is empty."""
        length = self.layout.length(field)
        if not length:
            return _NOTHING
        return np.frombuffer(self.data, "<f8", length, self.layout.fields[field].start)

    def vector(self, field: str) -> np.ndarray:
        """A copy of a field of numbers; raises BadMessage unless all are finite."""
        values = self.numbers(field).copy()
        if not math.isfinite(values.sum()):
            raise BadMessage(f"{field} is {values.tolist()}, finite numbers expected")
        return values


_NOTHING = np.zeros(0)


def _here(kind: type, data: bytes) -> bytes:
    """Serialize anew, in the byte order of this machine, what another one has sent."""
    try:
        return serialize_message(deserialize_message(data, kind))
    except Exception as error:  # rclpy raises its own classes, without a common base
        raise BadMessage(f"cannot be deserialized ({error})") from None


class TrajectoryWriter(Template):
    """A JointTrajectory with one point: rows positions, velocities, accelerations, effort.

    `values` holds a view (n,) for each row in use; write to them and publish `stamped(stamp)`.
    """

    ROWS = ("positions", "velocities", "accelerations", "effort")

    def __init__(self, names: Sequence[str], rows: Sequence[str] = ROWS[:3]):
        """names: of the n joints; rows: those of ROWS that are used."""
        point = JointTrajectoryPoint(**{row: [0.0] * len(names) for row in rows})
        message = JointTrajectory(joint_names=list(names), points=[point])
        message.header.frame_id = WORLD
        super().__init__(message)

    def fill(self, stamp: int, state: np.ndarray, time_from_start: int = 0) -> bytes:
        """Return the message with state (3, n): positions, velocities, accelerations."""
        values = self.values
        values["positions"][:] = state[0]
        values["velocities"][:] = state[1]
        values["accelerations"][:] = state[2]
        return self.stamped(stamp, time_from_start)


class IdleWriter(Template):
    """A JointTrajectory without names and points: nothing is commanded at its stamp."""

    def __init__(self):
        message = JointTrajectory()
        message.header.frame_id = WORLD
        super().__init__(message)


def trajectory(data: bytes) -> Serialized:
    """A received JointTrajectory; raises BadMessage."""
    return Serialized(JointTrajectory, data)


class TrajectoryReader:
    """Reads `rows` of trajectories of the joints `names`.

    Rows that lie next to each other in a message are as far apart as any two of them, so that one
    strided view holds them all.
    """

    def __init__(self, names: Sequence[str], rows: Sequence[str] = TrajectoryWriter.ROWS[:3]):
        """names: of the n joints; rows: adjacent ones of TrajectoryWriter.ROWS."""
        self._names, self._rows = list(names), list(rows)

    def read(self, message: Serialized) -> np.ndarray:
        """Return a copy (rows, n) of the first point's rows.

        Raises BadMessage on other joint names, wrong lengths, no point, or a number that is not
        finite.
        """
        checked = message.layout.checked.get(self)
        if checked is None:
            checked = message.layout.checked[self] = self._check(message.layout)
        shape, start, strides = checked
        values = np.ndarray(shape, "<f8", message.data, start, strides).copy()
        if not math.isfinite(values.sum()):
            for row, numbers in zip(self._rows, values, strict=True):
                _refuse_infinite(row, numbers, self._names)
            raise BadMessage("overflow")
        return values

    def _check(self, layout: Layout) -> tuple[tuple[int, int], int, tuple[int, int]]:
        """Shape, first byte and strides [bytes] of the rows; raises BadMessage."""
        names, rows = self._names, self._rows
        check_names(layout.names, names)
        if layout.points != 1:
            raise BadMessage(f"{layout.points} points, 1 expected")
        for row in rows:
            _check_length(row, layout.length(row), names)
        starts = [layout.fields[row].start for row in rows]
        stride = starts[1] - starts[0] if len(starts) > 1 else 0
        return (len(rows), len(names)), starts[0], (stride, 8)


def check_names(given: Sequence[str], expected: Sequence[str]) -> None:
    """Raise BadMessage unless `given` are exactly the expected joint names, in order."""
    if list(given) != list(expected):
        raise BadMessage(
            f"joint names {', '.join(given) or '(none)'}; expected {', '.join(expected)}"
        )


def _check_length(what: str, length: int, names: Sequence[str]) -> None:
    if length != len(names):
        raise BadMessage(f"{length} {what}, {len(names)} expected ({', '.join(names)})")


def _refuse_infinite(what: str, values: np.ndarray, names: Sequence[str]) -> None:
    if not math.isfinite(values.sum()):
        for name, value in zip(names, values, strict=True):
            if not math.isfinite(value):
                raise BadMessage(f"{what} of {name} is {value}")
        raise BadMessage(f"{what} overflow")


class JointStateWriter(Template):
    """A JointState whose views position, velocity, effort (n,) are written and published."""

    def __init__(self, names: Sequence[str]):
        """names: of the n joints."""
        zeros = [0.0] * len(names)
        super().__init__(JointState(name=list(names), position=zeros, velocity=zeros, effort=zeros))
        self.position, self.velocity, self.effort = self.values.values()


def read_joints(data: bytes, names: Sequence[str]) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], position (n,) [rad], velocity (n,) [rad/s]) in the order of `names`.

    The message may hold further joints, in any order, as /joint_states does on robots. Raises
    BadMessage where one of `names` or a number is missing or not finite.
    """
    message = Serialized(JointState, data)
    order, found = message.layout.names, []
    for what, field in (("positions", "position"), ("velocities", "velocity")):
        values = message.numbers(field)
        if len(values) != len(order):
            raise BadMessage(f"{len(values)} {what} for {len(order)} joints")
        if order != names:
            try:
                values = values[[order.index(name) for name in names]]
            except ValueError:
                check_names(order, names)
        _refuse_infinite(what, values, names)
        found.append(values)
    return message.stamp, *found


def read_values(data: bytes, field: str) -> tuple[int, list[str], np.ndarray]:
    """Return (stamp [ns], names, values (n,)) of one field of a JointState, finite or not.

    The values are NaN where the message leaves the field empty; raises BadMessage where there are
    more or fewer than names.
    """
    message = Serialized(JointState, data)
    names, values = message.layout.names, message.numbers(field)
    if not len(values):
        return message.stamp, names, np.full(len(names), math.nan)
    _check_length(field, len(values), names)
    return message.stamp, names, values


class ImuWriter(Template):
    """An Imu without orientation (orientation_covariance[0] = -1)."""

    def __init__(self):
        message = Imu()
        message.header.frame_id = BODY
        message.orientation_covariance[0] = -1.0
        super().__init__(message)
        self._gyro = self.values["angular_velocity"]
        self._force = self.values["linear_acceleration"]

    def fill(self, stamp: int, gyro: np.ndarray, specific_force: np.ndarray) -> bytes:
        """Return the message; gyro (3,) [rad/s], specific_force (3,) [m/s^2], FLU."""
        self._gyro[:], self._force[:] = gyro, specific_force
        return self.stamped(stamp)


def read_imu(data: bytes) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], gyro (3,) [rad/s], specific force (3,) [m/s^2]), FLU."""
    message = Serialized(Imu, data)
    return message.stamp, message.vector("angular_velocity"), message.vector("linear_acceleration")


class PoseWriter(Template):
    """A PoseStamped in the world frame."""

    def __init__(self):
        message = PoseStamped()
        message.header.frame_id = WORLD
        super().__init__(message)
        self._position, self._orientation = self.values["position"], self.values["orientation"]

    def fill(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> bytes:
        """Return the message; position (3,) [m], quaternion [w x y z] body → world."""
        self._position[:] = position
        self._orientation[:3], self._orientation[3] = quaternion[1:], quaternion[0]
        return self.stamped(stamp)


def read_pose(data: bytes, frame: str = WORLD) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], position (3,) [m], quaternion [w x y z], normalised).

    Raises BadMessage for another frame, or numbers that are not finite or not a rotation.
    """
    message = Serialized(PoseStamped, data)
    if message.layout.frame != frame:
        raise BadMessage(f"frame '{message.layout.frame}', expected '{frame}'")
    quaternion = np.roll(message.numbers("orientation"), 1)
    norm = math.sqrt(quaternion @ quaternion)
    if not abs(norm - 1.0) < 0.01:
        raise BadMessage(f"orientation has norm {norm:.3g}, 1 expected")
    if not abs(norm - 1.0) < 1e-12:  # rounding errors may stay
        quaternion = quaternion / norm
    return message.stamp, message.vector("position"), quaternion


class EffortWriter(Template):
    """A Float64MultiArray of the ros2_control effort controllers."""

    def __init__(self, count: int):
        super().__init__(Float64MultiArray(data=[0.0] * count))
        self._effort = self.values["data"]

    def fill(self, effort: np.ndarray) -> bytes:
        """Return the message; effort (n,) [N m]."""
        self._effort[:] = effort
        return self.plain()


def read_effort(data: bytes, names: Sequence[str]) -> np.ndarray:
    """Return the efforts (n,) [N m]; raises BadMessage on a wrong number of joints or a NaN."""
    effort = Serialized(Float64MultiArray, data).numbers("data")
    _check_length("efforts", len(effort), names)
    _refuse_infinite("effort", effort, names)
    return effort


class SetpointWriter(Template):
    """The TwistStamped that repeats what was sent to the autopilot."""

    def __init__(self):
        message = TwistStamped()
        message.header.frame_id = BODY
        super().__init__(message)
        self._rates, self._linear = self.values["angular"], self.values["linear"]

    def fill(self, stamp: int, rates: np.ndarray, thrust: float) -> bytes:
        """Return the message; rates (3,) [rad/s, FLU], thrust 0..1."""
        self._rates[:] = rates
        self._linear[2] = thrust
        return self.stamped(stamp)


def read_setpoint(data: bytes) -> tuple[int, np.ndarray, float]:
    """Return (stamp [ns], body rates (3,) [rad/s, FLU], thrust 0..1)."""
    message = Serialized(TwistStamped, data)
    return message.stamp, message.vector("angular"), float(message.vector("linear")[2])


def read_switch(data: bytes) -> bool:
    """Whether a Bool is true; raises BadMessage."""
    if len(data) <= ENCAPSULATION:
        raise BadMessage(f"{len(data)} bytes, too short for a Bool")
    return data[ENCAPSULATION] != 0
