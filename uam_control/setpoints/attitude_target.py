"""Setpoint of attitude or body rates (SET_ATTITUDE_TARGET): the type masks that are flown.

| type_mask | ignored | flown |
|---|---|---|
| 128 | attitude | body rates and thrust |
| 7 | body rates | attitude and thrust |
| 3 | roll rate, pitch rate | attitude and thrust, with a yaw rate on top |

Source: MAVLink, ATTITUDE_TARGET_TYPEMASK; PX4 v1.16, MavlinkReceiver, handling of
SET_ATTITUDE_TARGET.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.frames import swap_body

RATES, ATTITUDE, ATTITUDE_AND_YAW_RATE = 128, 7, 3  # type masks
FLOWN = "128 (body rates), 7 (attitude), 3 (attitude and yaw rate)"
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
STILL = np.zeros(3)
NO_RATES = np.full(3, math.nan)


class AttitudeTarget(NamedTuple):
    """One setpoint for the autopilot, in its frames.

    quaternion (4,): desired attitude FRD → NED [w x y z]; rates (3,): body rates [rad/s, FRD], for
    ATTITUDE_AND_YAW_RATE the last is the rate about the world's vertical axis, positive downwards;
    thrust: 0..1.
    """

    type_mask: int
    quaternion: np.ndarray
    rates: np.ndarray
    thrust: float

    @classmethod
    def of_rates(cls, rates: np.ndarray, thrust: float) -> AttitudeTarget:
        """Return the setpoint of body rates (3,) [rad/s, FRD] and thrust 0..1."""
        return cls(RATES, UPRIGHT, rates, thrust)

    @classmethod
    def of_attitude(cls, quaternion: np.ndarray, thrust: float) -> AttitudeTarget:
        """Return the setpoint of an attitude (4,) FRD → NED [w x y z] and thrust 0..1."""
        return cls(ATTITUDE, quaternion, STILL, thrust)

    @property
    def body_rates(self) -> np.ndarray:
        """Body rates (3,) [rad/s, FLU]; NaN where it has none."""
        return swap_body(self.rates) if self.type_mask == RATES else NO_RATES

    def refused(self) -> str:
        """Return why no autopilot should fly it: the mask, or what is not finite; "" if nothing."""
        total = self.thrust + sum(self.rates.tolist())
        if self.type_mask != RATES:
            if self.type_mask not in (ATTITUDE, ATTITUDE_AND_YAW_RATE):
                return f"type_mask {self.type_mask}, allowed: {FLOWN}"
            q = self.quaternion
            squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
            if squared == 0.0:
                return "the attitude is no quaternion"
            total += squared
        return "" if math.isfinite(total) else "not finite"
