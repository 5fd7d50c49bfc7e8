"""Whether the thrust suffices for a payload: by its mass before the pick, then by what is sent.

A rotor at its end shows late: the autopilot then takes thrust for its torques, the vehicle sinks a
little, and the thrust that is sent rises to 1.
"""

import math

from uam_control.grasp.grasp_parameters import GraspParameters
from uam_control.grasp.sight import Lasting, Sight
from uam_control.vehicle import GRAVITY

SHORT_AFTER = 0.3  # [s] at carry_throttle
SUNK = 0.08  # [m] below the path


def expected_throttle(sight: Sight, mass: float) -> float:
    """Return the thrust as sent, 0..1, with a further mass [kg]; NaN if unknown.

    Thrust is proportional to it where THR_MDL_FAC is the motors', see `thrust_curve`.
    """
    return sight.throttle * (1.0 + mass * GRAVITY / sight.lift) if sight.lift > 0.0 else math.nan


class ThrustReserve:
    """`short`: whether the thrust has been at its end for SHORT_AFTER."""

    def __init__(self) -> None:
        self._at_end = Lasting()
        self.short = False

    def restart(self) -> None:
        """Forget all values."""
        self._at_end.restart()
        self.short = False

    def add(self, sight: Sight, p: GraspParameters) -> None:
        """Take the next sight."""
        lasts = self._at_end(sight.stamp, sight.throttle >= p.carry_throttle)
        self.short = lasts >= SHORT_AFTER

    def sinks(self, sight: Sight) -> bool:
        """Return whether the vehicle sinks for want of thrust."""
        return self.short and bool(sight.error[2] < -SUNK)
