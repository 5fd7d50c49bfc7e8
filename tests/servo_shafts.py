"""Shafts of emulated servos: one at values that a test sets, and a joint with friction."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from uam_sim_bridge.devices.dynamixel.emulated import Drive

STEP = 0.0005  # [s] of the simulated joint
LONGEST_PAUSE = 0.1  # [s] simulated after a stall


@dataclass
class StillShaft:
    """A shaft at values that the test sets; the current follows its goal."""

    angle: float = 0.0
    velocity: float = 0.0
    last: Drive = field(default_factory=Drive)

    def sense(self) -> tuple[float, float, float]:
        """Return the set values."""
        return self.angle, self.velocity, self.last.current if self.last.on else 0.0

    def drive(self, drive: Drive) -> None:
        """Store the drive."""
        self.last = drive


@dataclass
class FrictionShaft:
    """One joint: motor, Coulomb and viscous friction, inertia, weight; `sense` advances it to now.

    inertia [kg m^2]; coulomb [N m]; viscous [N m s/rad]; torque_constant [N m/A]; weight [N m]:
    torque of gravity at angle 90 deg, 0 at angle 0, where the link hangs; clock [s].
    """

    inertia: float = 0.01
    coulomb: float = 0.1
    viscous: float = 0.03
    torque_constant: float = 1.3
    weight: float = 0.3
    angle: float = 0.0
    velocity: float = 0.0
    clock: Callable[[], float] = time.monotonic
    stiffness: float = 5.0  # [N m/rad] of the position modes
    last: Drive = field(default_factory=Drive)
    current: float = 0.0  # [A]

    def __post_init__(self) -> None:
        """Begin now."""
        self._time = self.clock()

    def sense(self) -> tuple[float, float, float]:
        """Advance to now and return angle, velocity and current."""
        self._advance()
        return self.angle, self.velocity, self.current

    def drive(self, drive: Drive) -> None:
        """Advance with the drive until now; take the new one."""
        self._advance()
        self.last = drive
        self.current = self._current()

    def _advance(self) -> None:
        now = self.clock()
        span = min(now - self._time, LONGEST_PAUSE)
        self._time = now
        steps = math.ceil(span / STEP - 1e-6)
        for _ in range(steps):
            self.current = self._current()
            self._step(self.torque_constant * self.current, span / steps)

    def _current(self) -> float:
        if not self.last.on:
            return 0.0
        if self.last.mode == 0:
            return self.last.current
        error = self.last.position - self.angle
        pull = self.stiffness * error - 0.1 * self.velocity
        return pull / self.torque_constant

    def _step(self, torque: float, step: float) -> None:
        """One semi-implicit step; friction stops the joint, but does not reverse it."""
        free = self.velocity + step / self.inertia * (torque - self.weight * math.sin(self.angle))
        brake = step / self.inertia * self.coulomb
        slowed = math.copysign(max(0.0, abs(free) - brake), free)
        self.velocity = slowed / (1.0 + step / self.inertia * self.viscous)
        self.angle += step * self.velocity
