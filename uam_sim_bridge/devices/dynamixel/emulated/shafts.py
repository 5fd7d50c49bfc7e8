"""What an emulated servo turns: the interface, and the joints of a plant.

Angles of a shaft are those of the servo's output, counter-clockwise positive, 0 at position 2048.
"""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from uam_sim_bridge.devices.dynamixel.chain import ServoDescription
from uam_sim_bridge.devices.dynamixel.control_table import CURRENT_MODE


@dataclass(frozen=True)
class Drive:
    """What the servo's electronics do to the motor."""

    on: bool = False  # torque enabled
    mode: int = 0  # value of Operating Mode
    current: float = 0.0  # [A] goal, within the current limit
    position: float = 0.0  # [rad] goal, in the position modes only


class Shaft(Protocol):
    """The mechanical side of a servo: read by its sensors, moved by its motor."""

    def sense(self) -> tuple[float, float, float]:
        """Return angle [rad], velocity [rad/s] and motor current [A] now."""

    def drive(self, drive: Drive) -> None:
        """Take what the electronics do from now on; called at each change."""


class ArmShafts:
    """Shafts of a chain whose joints move in a plant; the plant may run in another thread.

    The plant calls `set` at each tick and reads `command`. Wiring mistakes are made by another
    description than the driver's.
    """

    def __init__(self, servos: Sequence[ServoDescription]) -> None:
        """servos: as mounted, in the order of the plant's joints."""
        self._lock = threading.Lock()
        self.shafts = [JointShaft(servo, self._lock) for servo in servos]

    def set(self, angle: np.ndarray, velocity: np.ndarray, torque: np.ndarray) -> None:
        """Take angles (n,) [rad], velocities (n,) [rad/s] and motor torques (n,) [N m]."""
        with self._lock:
            for shaft, *state in zip(self.shafts, angle, velocity, torque, strict=True):
                shaft.state = tuple(map(float, state))

    def command(self, in_position_mode: bool) -> np.ndarray:
        """Return the efforts (n,) [N m], or the goals (n,) [rad], NaN without torque.

        In current mode a servo without torque has effort 0; one that holds its position in current
        mode's stead gives none, too.
        """
        with self._lock:
            return np.array([shaft.command(in_position_mode) for shaft in self.shafts])


class JointShaft:
    """One joint as a shaft; `state`: angle [rad], velocity [rad/s], motor torque [N m]."""

    def __init__(self, servo: ServoDescription, lock: threading.Lock) -> None:
        self._servo, self._lock, self._drive = servo, lock, Drive()
        self.state = (servo.stowed, 0.0, 0.0)

    def sense(self) -> tuple[float, float, float]:
        """Return angle [rad] and velocity [rad/s] of the servo's output, and its current [A]."""
        servo = self._servo
        with self._lock:
            angle, velocity, torque = self.state
        turn = servo.table.counts_per_turn
        counts = servo.zero + angle / servo.count - turn // 2
        return (
            counts * 2.0 * math.pi / turn,
            servo.direction * velocity * servo.gear,
            servo.direction * torque / servo.torque_constant,
        )

    def drive(self, drive: Drive) -> None:
        with self._lock:
            self._drive = drive

    def command(self, in_position_mode: bool) -> float:
        """Return effort [N m] or goal [rad]; see `ArmShafts.command`."""
        drive, servo = self._drive, self._servo
        if in_position_mode:
            turn = servo.table.counts_per_turn
            counts = drive.position * turn / (2.0 * math.pi) + turn // 2
            return (counts - servo.zero) * servo.count if drive.on else math.nan
        if not drive.on or drive.mode != CURRENT_MODE:
            return 0.0
        return servo.direction * drive.current * servo.torque_constant
