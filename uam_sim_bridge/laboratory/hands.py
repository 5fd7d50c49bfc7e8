"""The hands of a person on vehicle and arm: springs and dampers towards a pose that they follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ALPHA, ATTITUDE, CHI, CHI_DOT, POSITION
from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_euler,
)

# of the whole vehicle, 2.2 kg and 0.02 kg m^2: about 2 Hz, well damped
STIFFNESS, DAMPING = 400.0, 50.0  # [N/m], [N s/m]
TURN_STIFFNESS, TURN_DAMPING = 6.0, 0.6  # [N m/rad], [N m s/rad]
JOINT_STIFFNESS, JOINT_DAMPING = 4.0, 0.3  # [N m/rad], [N m s/rad]
JOINT_LIMIT = 2.0  # [N m]


@dataclass
class Grip:
    """Where the hands want the vehicle: pose (6,) x y z roll pitch yaw [m, rad, ENU], and joints.

    pose None: the hands are off; joints (n,) [rad] None: the hands are off the arm.
    """

    pose: np.ndarray | None = None
    joints: np.ndarray | None = None


def wrench(grip: Grip, state: np.ndarray, weight: float) -> tuple[np.ndarray, np.ndarray]:
    """Return force (3,) [N, ENU] and torque (3,) [N m, FLU] on the base; zeros without a grip.

    state (3, 6 + n): true chi, see `coordinates`; weight [N] of the vehicle, which the hands carry.
    """
    if grip.pose is None:
        return np.zeros(3), np.zeros(3)
    chi, rates = state[CHI], state[CHI_DOT]
    force = STIFFNESS * (grip.pose[:3] - chi[POSITION]) - DAMPING * rates[POSITION]
    force[2] += weight
    desired = matrix_from_quaternion(quaternion_from_euler(grip.pose[3:]))
    present = matrix_from_quaternion(quaternion_from_euler(chi[ATTITUDE].copy()))
    skew = present.T @ desired - desired.T @ present
    error = 0.5 * np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    return force, TURN_STIFFNESS * error - TURN_DAMPING * rates[ATTITUDE]


def joint_torque(grip: Grip, state: np.ndarray) -> np.ndarray:
    """Return the torque (n,) [N m] of the hands on the joints; state: see `wrench`."""
    alpha, alpha_dot = state[CHI, ALPHA:], state[CHI_DOT, ALPHA:]
    if grip.joints is None:
        return np.zeros(len(alpha))
    torque = JOINT_STIFFNESS * (grip.joints - alpha) - JOINT_DAMPING * alpha_dot
    return np.clip(torque, -JOINT_LIMIT, JOINT_LIMIT)
