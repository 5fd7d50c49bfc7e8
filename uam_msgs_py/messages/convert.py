"""NumPy arrays ↔ serialized ROS messages, without message objects to save time at 250 Hz.

Writers put numbers into a serialized message (`serialized.py`). Readers take serialized messages
(raw subscriptions), check names, lengths, frames and numbers, and raise BadMessage in one line.
Only this module converts quaternions between [w x y z] (maths) and x, y, z, w (ROS).
Stamps are integer nanoseconds.
"""

import math
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from uam_msgs_py.messages.layouts import ENCAPSULATION, BadMessage, Layout
from uam_msgs_py.messages.serialized import (
    Serialized,
    Template,
    all_finite,
    check_length,
    check_names,
    refuse_infinite,
)
from uam_msgs_py.messages.topics import BODY, WORLD

W_FIRST = np.array([3, 0, 1, 2])  # x y z w of ROS → w x y z
SWITCH = {on: serialize_message(Bool(data=on)) for on in (False, True)}


GRIPPER = "gripper"  # among the joints: opening [m] and closing force [N] of two fingers


class JointStateWriter(Template):
    """Writes a JointState: set the views position, velocity, effort (n,), publish `stamped`."""

    def __init__(self, names: Sequence[str], frame: str = ""):
        """names: of the n joints; frame: in which they are, "" for none."""
        zeros = [0.0] * len(names)
        made = JointState(name=list(names), position=zeros, velocity=zeros, effort=zeros)
        super().__init__(made, frame)
        self.position, self.velocity, self.effort = self.values.values()


def read_joints(data: bytes, names: Sequence[str]) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], position (n,) [rad], velocity (n,) [rad/s]) in the order of `names`.

    The message may contain further joints and any order, as /joint_states of a robot. Raises
    BadMessage if one of `names` or a number is missing, or a number is not finite.
    """
    message = Serialized(JointState, data)
    order, found = message.layout.names, []
    for what, field in (("positions", "position"), ("velocities", "velocity")):
        values = message.numbers(field)
        if len(values) != len(order):
            raise BadMessage(f"{len(values)} {what} for {len(order)} joints")
        values = _ordered(values, order, names)
        refuse_infinite(what, values, names)
        found.append(values)
    return message.stamp, *found


def read_values(data: bytes, field: str) -> tuple[int, list[str], np.ndarray]:
    """Return (stamp [ns], names, values (n,)) of one field of a JointState.

    Values may be infinite or NaN; all are NaN if the field is empty. Raises BadMessage if the
    numbers of values and names differ.
    """
    message = Serialized(JointState, data)
    names, values = message.layout.names, message.numbers(field)
    if not len(values):
        return message.stamp, names, np.full(len(names), math.nan)
    check_length(field, len(values), names)
    return message.stamp, names, values


def read_efforts(data: bytes, names: Sequence[str]) -> tuple[int, np.ndarray]:
    """Return (stamp [ns], effort (n,) [N m]) in the order of `names`, NaN where there is none.

    Raises BadMessage if one of `names` is missing.
    """
    stamp, order, effort = read_values(data, "effort")
    return stamp, _ordered(effort, order, names)


def _ordered(values: np.ndarray, given: Sequence[str], names: Sequence[str]) -> np.ndarray:
    """Return the values of the joints `given` in the order of `names`; raises BadMessage."""
    if given != names:
        try:
            return values[[given.index(name) for name in names]]
        except ValueError:
            check_names(given, names)
    return values


def read_grip(data: bytes) -> np.ndarray | None:
    """Return opening [m] and closing force [N] (2,) of the fingers in a JointState, None without.

    Raises BadMessage for a message that contradicts itself.
    """
    _, names, opening = read_values(data, "position")
    if GRIPPER not in names:
        return None
    number, force = names.index(GRIPPER), read_values(data, "effort")[2]
    return np.array([opening[number], force[number]])


class ImuWriter(Template):
    """Writes an Imu without orientation (orientation_covariance[0] = -1)."""

    def __init__(self, frame: str = BODY):
        """frame: of the body."""
        message = Imu()
        message.orientation_covariance[0] = -1.0
        super().__init__(message, frame)
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
    """Writes a PoseStamped in the world frame."""

    def __init__(self):
        super().__init__(PoseStamped(), WORLD)
        self._position, self._orientation = self.values["position"], self.values["orientation"]

    def fill(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> bytes:
        """Return the message; position (3,) [m, world], quaternion (4,) body → world [w x y z]."""
        self._position[:] = position
        self._orientation[:3], self._orientation[3] = quaternion[1:], quaternion[0]
        return self.stamped(stamp)


def read_pose(data: bytes, frame: str = WORLD) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (stamp [ns], position (3,) [m], unit quaternion (4,) body → world [w x y z]).

    Raises BadMessage for another frame, numbers that are not finite, or a quaternion whose norm is
    not 1.
    """
    message = Serialized(PoseStamped, data)
    if message.layout.frame != frame:
        raise BadMessage(f"frame '{message.layout.frame}', expected '{frame}'")
    quaternion = message.numbers("orientation").take(W_FIRST)
    norm = math.sqrt(quaternion @ quaternion)
    if not abs(norm - 1.0) < 0.01:
        raise BadMessage(f"orientation has norm {norm:.3g}, 1 expected")
    if not abs(norm - 1.0) < 1e-12:  # unchanged within rounding errors
        quaternion = quaternion / norm
    return message.stamp, message.vector("position"), quaternion


class JointCommandWriter(Template):
    """Writes the Float64MultiArray of a ros2_control effort or position controller."""

    def __init__(self, count: int):
        super().__init__(Float64MultiArray(data=[0.0] * count))
        self._command = self.values["data"]

    def fill(self, command: np.ndarray) -> bytes:
        """Return the message; command (n,): efforts [N m] or goal positions [rad]."""
        self._command[:] = command
        return self.plain()


def read_joint_command(data: bytes, names: Sequence[str]) -> np.ndarray:
    """Return efforts [N m] or goal positions [rad] (n,); raises BadMessage for a wrong length or a
    value not finite."""
    command = Serialized(Float64MultiArray, data).numbers("data")
    check_length("joint commands", len(command), names)
    refuse_infinite("joint command", command, names)
    return command


class SetpointWriter(Template):
    """Writes the TwistStamped with the setpoint that was sent to the autopilot."""

    def __init__(self, frame: str = BODY):
        """frame: of the body."""
        super().__init__(TwistStamped(), frame)
        self._rates, self._linear = self.values["angular"], self.values["linear"]

    def fill(self, stamp: int, rates: np.ndarray, thrust: float) -> bytes:
        """Return the message; rates (3,) [rad/s, FLU], thrust 0..1."""
        self._rates[:] = rates
        self._linear[2] = thrust
        return self.stamped(stamp)


def read_switch(data: bytes) -> bool:
    """Return the value of a Bool; raises BadMessage."""
    if len(data) <= ENCAPSULATION:
        raise BadMessage(f"{len(data)} bytes, too short for a Bool")
    return data[ENCAPSULATION] != 0


class TrajectoryWriter(Template):
    """Writes a JointTrajectory with one point: rows positions, velocities, accelerations, effort.

    `values`: row name → view (n,). Write to the views, then publish `stamped(stamp)`.
    """

    ROWS = ("positions", "velocities", "accelerations", "effort")

    def __init__(self, names: Sequence[str], rows: Sequence[str] = ROWS[:3], frame: str = WORLD):
        """names: of the n joints; rows: used rows, a subset of ROWS; frame: of the numbers."""
        point = JointTrajectoryPoint(**{row: [0.0] * len(names) for row in rows})
        super().__init__(JointTrajectory(joint_names=list(names), points=[point]), frame)

    def fill(self, stamp: int, state: np.ndarray, time_from_start: int = 0) -> bytes:
        """Return the message with state (3, n): positions, velocities, accelerations."""
        values = self.values
        values["positions"][:] = state[0]
        values["velocities"][:] = state[1]
        values["accelerations"][:] = state[2]
        return self.stamped(stamp, time_from_start)


class CommandWriter(TrajectoryWriter):
    """Writes a command, or no command: a JointTrajectory without names and points."""

    def __init__(self, names: Sequence[str], rows: Sequence[str], frame: str = WORLD):
        """See TrajectoryWriter."""
        super().__init__(names, rows, frame)
        self._idle = Template(JointTrajectory(), frame)

    def idle(self, stamp: int) -> bytes:
        """Return the message without a command at this stamp [ns]."""
        return self._idle.stamped(stamp)


class TrajectoryReader:
    """Reads `rows` of trajectories of the joints `names`.

    Adjacent rows have equal distances in the message, so one strided view covers all rows.
    """

    def __init__(self, names: Sequence[str], rows: Sequence[str] = TrajectoryWriter.ROWS[:3]):
        """names: of the n joints; rows: adjacent ones of TrajectoryWriter.ROWS."""
        self._names, self._rows = list(names), list(rows)

    def read(self, message: Serialized) -> np.ndarray:
        """Return a copy (rows, n) of the first point's rows.

        Raises BadMessage for other joint names, wrong lengths, not one point, or a number that is
        not finite.
        """
        checked = message.layout.checked.get(self)
        if checked is None:
            checked = message.layout.checked[self] = self._check(message.layout)
        shape, start, strides = checked
        values = np.ndarray(shape, "<f8", message.data, start, strides).copy()
        if not all_finite(values):
            for row, numbers in zip(self._rows, values, strict=True):
                refuse_infinite(row, numbers, self._names)
            raise BadMessage("overflow")
        return values

    def _check(self, layout: Layout) -> tuple[tuple[int, int], int, tuple[int, int]]:
        """Return shape, first byte and strides [bytes] of the rows; raises BadMessage."""
        names, rows = self._names, self._rows
        check_names(layout.names, names)
        if layout.points != 1:
            raise BadMessage(f"{layout.points} points, 1 expected")
        for row in rows:
            check_length(row, layout.length(row), names)
        starts = [layout.fields[row].start for row in rows]
        stride = starts[1] - starts[0] if len(starts) > 1 else 0
        return (len(rows), len(names)), starts[0], (stride, 8)
