"""Setpoint of torque and thrust (SET_ACTUATOR_CONTROL_TARGET, group 0).

The autopilot allocates it to the motors; its attitude and rate loops do not act. Source: MAVLink
common, message 139; PX4 v1.14 to v1.16, MavlinkReceiver: controls 0 to 2 are the torque setpoint, 3
is the thrust setpoint. PX4 v1.17 has no handler for the message.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.setpoints.attitude_target import NO_RATES


class WrenchTarget(NamedTuple):
    """One setpoint of the autopilot's allocation.

    torque (3,): normalised, -1..1, FRD; thrust: normalised collective, 0..1.
    """

    torque: np.ndarray
    thrust: float

    @property
    def body_rates(self) -> np.ndarray:
        """Body rates (3,) [rad/s, FLU]: NaN, it has none."""
        return NO_RATES

    def refused(self) -> str:
        """Return why no autopilot should fly it: what is not finite; "" if nothing."""
        return "" if math.isfinite(self.torque.sum() + self.thrust) else "not finite"
