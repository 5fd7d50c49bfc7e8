"""What an autopilot is given: the desired motion, a setpoint made of a part of it, and poses.

Setpoints are as MAVLink has them: attitude or body rates, motion, torque; which are flown:
SET_ATTITUDE_TARGET:

| type_mask | ignored | flown |
|---|---|---|
| 128 | attitude | body rates and thrust |
| 7 | body rates | attitude and thrust |
| 3 | roll rate, pitch rate | attitude and thrust, with a yaw rate on top |

SET_POSITION_TARGET_LOCAL_NED: position and yaw are required. Velocity, acceleration and yaw rate
are feedforwards; a type mask may leave each of them out.

SET_ACTUATOR_CONTROL_TARGET, group 0: the autopilot allocates torque and thrust to the motors; its
attitude and rate loops do not act. PX4 v1.14 to v1.16: controls 0 to 2 are the torque setpoint, 3
is the thrust setpoint. PX4 v1.17 has no handler for the message.

Source: MAVLink common, ATTITUDE_TARGET_TYPEMASK, POSITION_TARGET_TYPEMASK, message 139; PX4 v1.16,
MavlinkReceiver.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import CHI, Z
from uam_control.frames import swap_body

RATES, ATTITUDE, ATTITUDE_AND_YAW_RATE = 128, 7, 3  # type masks
FLOWN = "128 (body rates), 7 (attitude), 3 (attitude and yaw rate)"
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
STILL = np.zeros(3)
NO_RATES = np.full(3, math.nan)  # body rates [rad/s] of a setpoint that has none
VELOCITY_IGNORED, ACCELERATION_IGNORED, YAW_RATE_IGNORED = 0x038, 0x1C0, 0x800
FLOWN_MASKS = tuple(
    velocity | acceleration | rate
    for velocity in (0, VELOCITY_IGNORED)
    for acceleration in (0, ACCELERATION_IGNORED)
    for rate in (0, YAW_RATE_IGNORED)
)


class AttitudeTarget(NamedTuple):
    """One setpoint for the autopilot, in its frames."""

    type_mask: int
    quaternion: np.ndarray  # (4,) FRD → NED [w x y z]
    rates: np.ndarray  # (3,) [rad/s, FRD]; of ATTITUDE_AND_YAW_RATE the last: about down, world
    thrust: float  # 0..1

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
        total, fields = self.thrust + sum(self.rates.tolist()), ("rates", "thrust")
        if self.type_mask != RATES:
            if self.type_mask not in (ATTITUDE, ATTITUDE_AND_YAW_RATE):
                return f"type_mask {self.type_mask}, allowed: {FLOWN}"
            q = self.quaternion
            squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
            if squared == 0.0:
                return "the attitude is no quaternion"
            total, fields = total + squared, ("quaternion", *fields)
        return "" if math.isfinite(total) else not_finite(self, fields)


class PositionTarget(NamedTuple):
    """One setpoint for the autopilot's position control; NED. What the mask ignores is 0."""

    type_mask: int
    position: np.ndarray  # (3,) [m]
    velocity: np.ndarray  # (3,) [m/s]
    acceleration: np.ndarray  # (3,) [m/s^2]
    yaw: float  # [rad] clockwise from north
    yaw_rate: float  # [rad/s]
    body_rates = NO_RATES
    thrust = math.nan  # the autopilot chooses it

    def refused(self) -> str:
        """Return why no autopilot should fly it: the mask, or what is not finite; "" if nothing."""
        if self.type_mask not in FLOWN_MASKS:
            return f"type_mask {self.type_mask}, allowed: position and yaw with or without the rest"
        total = self.position.sum() + self.velocity.sum() + self.acceleration.sum()
        total += self.yaw + self.yaw_rate
        return "" if math.isfinite(total) else not_finite(self, self._fields)


class WrenchTarget(NamedTuple):
    """One setpoint of the autopilot's allocation."""

    torque: np.ndarray  # (3,) normalised, -1..1, FRD
    thrust: float  # normalised collective, 0..1
    body_rates = NO_RATES

    def refused(self) -> str:
        """Return why no autopilot should fly it: what is not finite; "" if nothing."""
        total = self.torque.sum() + self.thrust
        return "" if math.isfinite(total) else not_finite(self, self._fields)


def not_finite(target: NamedTuple, fields: Iterable[str]) -> str:
    """Return which of the target's `fields` is not finite; the sum of all of them is not."""
    for field in fields:
        values = np.atleast_1d(getattr(target, field))
        axes = [f".{axis}" for axis in "wxyz"[-values.size :]] if values.size > 1 else [""]
        for axis, value in zip(axes, values.tolist(), strict=True):
            if not math.isfinite(value):
                return f"{field}{axis} is {value}, not finite"
    return "the sum of its numbers is not finite"


@dataclass(slots=True)
class Desired:
    """The desired motion, from the control laws or from the level hold."""

    rates: np.ndarray  # (3,) that make tau_q in the autopilot's rate loop [rad/s, FLU]
    attitude: np.ndarray  # (3, 3) q_d [rad, FLU in ENU]; Omega_d, Omega_d_dot [SI, desired FLU]
    thrust: float  # 0..1
    reference: np.ndarray | None = None  # (3, 3) position [m] and derivatives, ENU
    torque: np.ndarray | None = None  # (3,) tau_q in parts of the largest, FLU


# A setpoint type returns the part of the desired motion that is sent, in the autopilot's frames.
Target = AttitudeTarget | PositionTarget | WrenchTarget
SetpointType = Callable[[Desired], Target]


def level(yaw: float) -> np.ndarray:
    """Return `Desired.attitude` (3, 3) of a level vehicle at rest with `yaw` [rad]."""
    attitude = np.zeros((3, 3))
    attitude[CHI, Z] = yaw
    return attitude


class VisionPose(NamedTuple):
    """A mocap pose for the autopilot."""

    stamp: float  # [s]
    position: np.ndarray  # (3,) [m, ENU]
    quaternion: np.ndarray  # (4,) [w x y z], FLU → ENU
    position_deviation: float  # [m] standard deviation
    attitude_deviation: float  # [rad]
