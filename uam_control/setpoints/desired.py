"""The desired motion at a tick; a setpoint type sends a part of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import CHI, Z
from uam_control.setpoints.targets import AttitudeTarget, PositionTarget, WrenchTarget


@dataclass(slots=True)
class Desired:
    """The desired motion, from the control laws or from the level hold.

    rates (3,): body rates that make tau_q in the autopilot's rate loop [rad/s, FLU]; attitude
    (3, 3): rows q_d = roll, pitch, yaw [rad, FLU in ENU], Omega_d [rad/s], Omega_d_dot [rad/s^2],
    both in the desired body frame (FLU); thrust: 0..1; reference (3, 3): rows position [m],
    velocity [m/s], acceleration [m/s^2] of the mission, ENU; torque (3,): tau_q in parts of the
    largest torque, FLU; None: there is none.
    """

    rates: np.ndarray
    attitude: np.ndarray
    thrust: float
    reference: np.ndarray | None = None
    torque: np.ndarray | None = None


# A setpoint type returns the part of the desired motion that is sent, in the autopilot's frames.
Target = AttitudeTarget | PositionTarget | WrenchTarget
SetpointType = Callable[[Desired], Target]


def level(yaw: float) -> np.ndarray:
    """Return `Desired.attitude` (3, 3) of a level vehicle at rest with `yaw` [rad]."""
    attitude = np.zeros((3, 3))
    attitude[CHI, Z] = yaw
    return attitude
