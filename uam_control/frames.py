"""Conversion of ENU/FLU (REP-103, the ROS side) ↔ NED/FRD (the MAVLink side).

| | world | body |
|---|---|---|
| ROS side | ENU: x east, y north, z up | FLU: x forward, y left, z up |
| MAVLink side | NED: x north, y east, z down | FRD: x forward, y right, z down |

Every conversion is a half turn (world: about the north-east diagonal; body: about forward), hence
its own inverse: one function serves both directions.
Euler angles are Z-Y-X; quaternions are [w x y z], body → world.
"""

import math

import numpy as np

from uam_control.maths.compiled import jit

_HALF = math.sqrt(0.5)
_ABOUT_FORWARD = np.array([1.0, -1.0, -1.0])  # half turn of the body


@jit
def swap_world(v: np.ndarray) -> np.ndarray:
    """Convert a world vector v (3,) from ENU to NED, or back."""
    out = np.empty(3)
    out[0] = v[1]
    out[1] = v[0]
    out[2] = -v[2]
    return out


def swap_body(v: np.ndarray) -> np.ndarray:
    """Convert a body vector v (3,) from FLU to FRD, or back."""
    return v * _ABOUT_FORWARD


@jit
def swap_sample(
    gyro: np.ndarray, force: np.ndarray, other_gyro: np.ndarray, other_force: np.ndarray
) -> None:
    """Convert two body vectors (3,) as `swap_body`, into other_gyro and other_force (3,)."""
    for i in range(3):
        other_gyro[i] = gyro[i] if i == 0 else -gyro[i]
        other_force[i] = force[i] if i == 0 else -force[i]


@jit
def swap_quaternion(q: np.ndarray) -> np.ndarray:
    """Convert an attitude quaternion (4,) [w x y z] from FLU → ENU to FRD → NED, or back.

    It is the product (half turn about (1, 1, 0)) ⊗ q ⊗ (half turn about x), up to sign.
    """
    out = np.empty(4)
    out[0] = _HALF * (q[0] + q[3])
    out[1] = _HALF * (q[1] + q[2])
    out[2] = _HALF * (q[1] - q[2])
    out[3] = _HALF * (q[0] - q[3])
    return out


@jit
def swap_euler(euler: np.ndarray) -> np.ndarray:
    """Convert euler (3,), roll, pitch, yaw [rad] of FLU in ENU, to those of FRD in NED, or back.

    ENU yaw is counter-clockwise from east, NED yaw clockwise from north. Returned yaw: [-pi, pi).
    """
    out = np.empty(3)
    out[0] = euler[0]
    out[1] = -euler[1]
    out[2] = (1.5 * math.pi - euler[2]) % (2.0 * math.pi) - math.pi
    return out
