"""Setpoint of the motion (SET_POSITION_TARGET_LOCAL_NED): the type masks that are flown.

Position and yaw are required. Velocity, acceleration and yaw rate are feedforwards; a type mask may
leave each of them out. Source: MAVLink, POSITION_TARGET_TYPEMASK; PX4 v1.16, MavlinkReceiver.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.setpoints.attitude_target import NO_RATES

VELOCITY_IGNORED, ACCELERATION_IGNORED, YAW_RATE_IGNORED = 0x038, 0x1C0, 0x800
FLOWN_MASKS = tuple(
    velocity | acceleration | rate
    for velocity in (0, VELOCITY_IGNORED)
    for acceleration in (0, ACCELERATION_IGNORED)
    for rate in (0, YAW_RATE_IGNORED)
)


class PositionTarget(NamedTuple):
    """One setpoint of the motion for the autopilot's position control.

    position (3,) [m], velocity (3,) [m/s], acceleration (3,) [m/s^2]: NED; yaw [rad], yaw_rate
    [rad/s]: clockwise from north. Values that the type mask ignores are 0.
    """

    type_mask: int
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    yaw: float
    yaw_rate: float

    @property
    def body_rates(self) -> np.ndarray:
        """Body rates (3,) [rad/s, FLU]: NaN, it has none."""
        return NO_RATES

    @property
    def thrust(self) -> float:
        """NaN: the autopilot chooses the thrust."""
        return math.nan

    def refused(self) -> str:
        """Return why no autopilot should fly it: the mask, or what is not finite; "" if nothing."""
        if self.type_mask not in FLOWN_MASKS:
            return f"type_mask {self.type_mask}, allowed: position and yaw with or without the rest"
        total = self.position.sum() + self.velocity.sum() + self.acceleration.sum()
        return "" if math.isfinite(total + self.yaw + self.yaw_rate) else "not finite"
