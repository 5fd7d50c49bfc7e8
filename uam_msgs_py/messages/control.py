"""The messages of the control loop: state, reference, commands.

On the ground only the arm is controlled: the reference then contains only the joints, and the
position and attitude commands are idle messages, with a stamp but without values.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from trajectory_msgs.msg import JointTrajectory

from uam_control.coordinates import (
    ALPHA,
    ARM,
    ATTITUDE,
    BASE_COORDINATES,
    POSITION,
    arm_coordinates,
    coordinates,
)
from uam_msgs_py.messages.convert import CommandWriter, TrajectoryReader, TrajectoryWriter
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.serialized import Serialized

POSE_NAMES = list(BASE_COORDINATES)
ATTITUDE_NAMES = list(BASE_COORDINATES[ATTITUDE])
ALONE = list(arm_coordinates(1))  # how the names begin where the arm is alone
ROWS = TrajectoryWriter.ROWS[:3]
POSE = TrajectoryReader(POSE_NAMES, TrajectoryWriter.ROWS)
TAU_Q = TrajectoryReader(ATTITUDE_NAMES, ["effort"])


@cache
def whole(joints: int) -> TrajectoryReader:
    """Return the reader of all coordinates of a vehicle with so many joints."""
    return TrajectoryReader(coordinates(joints))


@cache
def arm_alone(joints: int) -> TrajectoryReader:
    """Return the reader of the coordinates of an arm with so many joints."""
    return TrajectoryReader(arm_coordinates(joints))


def read_state(data: bytes, joints: int | None = None) -> tuple[int, np.ndarray]:
    """Return (stamp [ns], chi, chi_dot, chi_ddot (3, 6 + n)); raises BadMessage.

    joints: n of the vehicle, None for as many as the message has.
    """
    message = Serialized(JointTrajectory, data)
    n = len(message.layout.names) - ALPHA if joints is None else joints
    return message.stamp, whole(n).read(message)


@dataclass(frozen=True)
class Reference:
    """values (3, 6 + n): chi_d, chi_d_dot, chi_d_ddot; if not flying only the arm's columns."""

    values: np.ndarray
    flying: bool


class ReferenceWriter:
    """Writes references of all coordinates or, on the ground, of the arm only."""

    def __init__(self, joints: int):
        """joints: how many the arm has."""
        self._whole = TrajectoryWriter(coordinates(joints))
        self._arm = TrajectoryWriter(arm_coordinates(joints))

    def fill(self, stamp: int, reference: np.ndarray, flying: bool, mission_time: int) -> bytes:
        """Return the message; stamp [ns], reference (3, 6 + n), mission_time [ns], at least 0."""
        if flying:
            return self._whole.fill(stamp, reference, mission_time)
        return self._arm.fill(stamp, reference[:, ARM], mission_time)


def read_reference(data: bytes, joints: int | None = None) -> tuple[int, Reference]:
    """Return (stamp [ns], reference); raises BadMessage. joints: see `read_state`."""
    message = Serialized(JointTrajectory, data)
    names = message.layout.names
    flying = names[:1] != ALONE
    n = joints
    if n is None:
        n = len(names) - ALPHA if flying else len(names)
    if flying:
        return message.stamp, Reference(whole(n).read(message), True)
    values = np.zeros((3, ALPHA + n))
    values[:, ARM] = arm_alone(n).read(message)
    return message.stamp, Reference(values, False)


@dataclass(frozen=True)
class PositionCommand:
    """Output of the position law. Zeros while idle."""

    tau: np.ndarray  # tau_p (3,) [N, world]
    attitude: np.ndarray  # (3, 3) rows q_d, Omega_d, Omega_d_dot
    flying: bool
    reference: np.ndarray  # (3, 3) rows p_d, p_d_dot, p_d_ddot


NO_COMMAND = PositionCommand(np.zeros(3), np.zeros((3, 3)), False, np.zeros((3, 3)))


class PositionCommandWriter(CommandWriter):
    """Writes the position controller's command: desired pose, its derivatives, and tau_p."""

    def __init__(self):
        super().__init__(POSE_NAMES, TrajectoryWriter.ROWS)

    def fill(
        self, stamp: int, reference: np.ndarray, attitude: np.ndarray, tau: np.ndarray
    ) -> bytes:
        """Return the message; stamp [ns], reference (3, 6 + n), attitude (3, 3): rows q_d, Omega_d,
        Omega_d_dot; tau (3,) [N, world]."""
        for i, row in enumerate(ROWS):
            values = self.values[row]
            values[POSITION] = reference[i, POSITION]
            values[ATTITUDE] = attitude[i]
        self.values["effort"][POSITION] = tau
        return self.stamped(stamp)


def read_position_command(data: bytes) -> tuple[int, PositionCommand]:
    """Return (stamp [ns], command); raises BadMessage."""
    message = Serialized(JointTrajectory, data)
    if not message.layout.names:
        if message.layout.points:
            raise BadMessage("points without joint names")
        return message.stamp, NO_COMMAND
    values = POSE.read(message)
    # a copy: a strided array would make Numba compile the control path a second time, in flight
    attitude, reference = values[:3, ATTITUDE].copy(), values[:3, POSITION].copy()
    return message.stamp, PositionCommand(values[3, POSITION], attitude, True, reference)


class TorqueWriter(CommandWriter):
    """Writes tau_q or tau_alpha as the effort of a trajectory point."""

    def __init__(self, names: list[str], frame: str = ""):
        """names: of the n coordinates; frame: of the torques, "" for those about joints."""
        super().__init__(names, ["effort"], frame)

    def fill(self, stamp: int, tau: np.ndarray) -> bytes:
        """Return the message; tau (n,) [N m]."""
        self.values["effort"][:] = tau
        return self.stamped(stamp)


def read_torque(data: bytes) -> tuple[int, np.ndarray | None]:
    """Return (stamp [ns], tau_q (3,) [N m, FLU], or None while idle); raises BadMessage."""
    message = Serialized(JointTrajectory, data)
    if not message.layout.names and not message.layout.points:
        return message.stamp, None
    return message.stamp, TAU_Q.read(message)[0]
