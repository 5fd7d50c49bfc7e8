"""The messages of the control loop and what "idle" means in each.

On the ground the vehicle is not controlled, only its arm is: the reference then names the joints
alone, and the position and attitude commands are stamped but empty.
"""

from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, COORDINATES, JOINTS, POSITION, SIZE
from uam_msgs_py.convert import (
    IdleWriter,
    TrajectoryWriter,
    check_names,
    read_trajectory,
    trajectory,
)
from uam_msgs_py.layouts import BadMessage

ALL = list(COORDINATES)
ARM_NAMES = list(JOINTS)
POSE_NAMES = list(COORDINATES[:6])
ATTITUDE_NAMES = list(COORDINATES[ATTITUDE])
ROWS = TrajectoryWriter.ROWS[:3]


def read_state(data: bytes) -> tuple[int, np.ndarray]:
    """Return (stamp [ns], chi, chi_dot, chi_ddot (3, 8)); raises BadMessage."""
    message, state = trajectory(data), np.empty((3, SIZE))
    read_trajectory(message, ALL, ROWS, state)
    return message.stamp, state


@dataclass(frozen=True)
class Reference:
    """chi_d, chi_d_dot, chi_d_ddot (3, 8); only the arm's columns count while not flying."""

    values: np.ndarray
    flying: bool


class ReferenceWriter:
    """Writes references of the whole vehicle or, while it is grounded, of the arm alone."""

    def __init__(self):
        self._whole, self._arm = TrajectoryWriter(ALL), TrajectoryWriter(ARM_NAMES)

    def fill(
        self, stamp: int, reference: np.ndarray, flying: bool, mission_time: int
    ) -> bytes:
        """Return the message; reference (3, 8), mission_time [ns] (not negative)."""
        if flying:
            return self._whole.fill(stamp, reference, mission_time)
        return self._arm.fill(stamp, reference[:, ARM], mission_time)


def read_reference(data: bytes) -> tuple[int, Reference]:
    """Return (stamp [ns], reference); raises BadMessage."""
    message, values = trajectory(data), np.zeros((3, SIZE))
    flying = message.layout.names != ARM_NAMES
    if flying:
        read_trajectory(message, ALL, ROWS, values)
    else:
        read_trajectory(message, ARM_NAMES, ROWS, values[:, ARM])
    return message.stamp, Reference(values, flying)


@dataclass(frozen=True)
class PositionCommand:
    """tau_p (3,) [N, world]; attitude (3, 3): rows q_d, Omega_d, Omega_d_dot. Zeros while idle."""

    tau: np.ndarray
    attitude: np.ndarray
    flying: bool


class PositionCommandWriter:
    """Writes what the position controller asks for."""

    def __init__(self):
        self._writer = TrajectoryWriter(POSE_NAMES, TrajectoryWriter.ROWS)
        self._idle = IdleWriter()

    def fill(
        self, stamp: int, reference: np.ndarray, attitude: np.ndarray, tau: np.ndarray
    ) -> bytes:
        """Return the message; reference (3, 8), attitude (3, 3), tau (3,) [N, world]."""
        for i, row in enumerate(ROWS):
            values = self._writer.values[row]
            values[POSITION] = reference[i, POSITION]
            values[ATTITUDE] = attitude[i]
        self._writer.values["effort"][POSITION] = tau
        return self._writer.stamped(stamp)

    def idle(self, stamp: int) -> bytes:
        """Return the empty message of this stamp [ns]."""
        return self._idle.stamped(stamp)


def read_position_command(data: bytes) -> tuple[int, PositionCommand]:
    """Return (stamp [ns], command); raises BadMessage."""
    message, values = trajectory(data), np.zeros((4, len(POSE_NAMES)))
    flying = bool(message.layout.names)
    if flying:
        read_trajectory(message, POSE_NAMES, TrajectoryWriter.ROWS, values)
    elif message.layout.points:
        raise BadMessage("points without joint names")
    command = PositionCommand(values[3, POSITION], values[:3, ATTITUDE], flying)
    return message.stamp, command


class TorqueWriter:
    """Writes tau_q or tau_alpha as the effort of a trajectory point."""

    def __init__(self, names: list[str]):
        self._writer = TrajectoryWriter(names, ["effort"])
        self._idle = IdleWriter()

    def fill(self, stamp: int, tau: np.ndarray) -> bytes:
        """Return the message; tau (n,) [N m]."""
        self._writer.values["effort"][:] = tau
        return self._writer.stamped(stamp)

    def idle(self, stamp: int) -> bytes:
        """Return the empty message of this stamp [ns]."""
        return self._idle.stamped(stamp)


def read_torque(data: bytes, names: list[str]) -> tuple[int, np.ndarray | None]:
    """Return (stamp [ns], torque (n,) [N m], or None while idle); raises BadMessage."""
    message = trajectory(data)
    if not message.layout.names and not message.layout.points:
        return message.stamp, None
    check_names(message.layout.names, names)
    torque = np.empty((1, len(names)))
    read_trajectory(message, names, ["effort"], torque)
    return message.stamp, torque[0]
