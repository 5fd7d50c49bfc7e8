"""The attitude loop, with PX4's structure (v1.16, AttitudeControl): attitude → body rates.

Roll and pitch have priority. The reduced attitude q_red turns the vehicle's z axis into the desired
one by the shortest rotation, without rotation about z. The remaining rotation to the desired
attitude is a yaw angle, which is multiplied by MC_YAW_WEIGHT:

    q_d = q_red q_yaw,   q_mix = q_red (q_yaw scaled),   q_e = q^-1 q_mix
    rates = P 2 Im(q_e) + yaw rate along the world's z axis, limited per axis

P contains MC_ROLL_P, MC_PITCH_P, and MC_YAW_P / MC_YAW_WEIGHT, so that the weight changes the share
of large yaw angles and not the gain.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import jit
from uam_control.maths.rotations import quaternion_multiply
from uam_sim_bridge.autopilot.params import Parameters

_OPPOSITE = 1.0 - 1e-5  # |x| or |y| of the reduced rotation, above which z must turn upside down
_PARALLEL = 1e-5  # norm of a cross product that counts as zero
# entries of `gains` (7,)
_P, _LIMIT, _WEIGHT = 0, 3, 6


def attitude_gains(parameters: Parameters) -> np.ndarray:
    """Return `gains` (7,): P of roll, pitch, yaw [1/s], their limits [rad/s], yaw weight."""
    weight = parameters["MC_YAW_WEIGHT"]
    gains = np.empty(7)
    gains[_P : _P + 3] = parameters.vector("MC_ROLL_P", "MC_PITCH_P", "MC_YAW_P")
    if weight > 1e-4:
        gains[_P + 2] /= weight
    limits = parameters.vector("MC_ROLLRATE_MAX", "MC_PITCHRATE_MAX", "MC_YAWRATE_MAX")
    gains[_LIMIT : _LIMIT + 3] = np.radians(limits)
    gains[_WEIGHT] = weight
    return gains


@jit
def attitude_rates(
    attitude: np.ndarray,
    desired: np.ndarray,
    yaw_rate: float,
    gains: np.ndarray,
    rates: np.ndarray,
) -> None:
    """Write the body-rate setpoint [rad/s, FRD] into rates (>= 3,).

    attitude, desired (4,): FRD → NED [w x y z], unit norm; yaw_rate [rad/s]: about the world's z
    axis, down; gains (7,): `attitude_gains`.
    """
    turn = _shortest(_z_axis(attitude), _z_axis(desired))
    if abs(turn[1]) > _OPPOSITE or abs(turn[2]) > _OPPOSITE:
        reduced = desired
    else:
        reduced = quaternion_multiply(turn, attitude)
    yaw = quaternion_multiply(_inverse(reduced), desired)
    if yaw[0] < 0.0:
        yaw = -yaw
    weight = gains[_WEIGHT]
    half = weight * math.acos(min(1.0, max(-1.0, yaw[0])))
    scaled = np.zeros(4)
    scaled[0] = math.cos(half)
    scaled[3] = math.sin(weight * math.asin(min(1.0, max(-1.0, yaw[3]))))
    error = quaternion_multiply(_inverse(attitude), quaternion_multiply(reduced, scaled))
    sign = 2.0 if error[0] >= 0.0 else -2.0
    down = _z_axis(_inverse(attitude))  # the world's z axis in the body
    for i in range(3):
        rate = sign * error[1 + i] * gains[_P + i] + yaw_rate * down[i]
        limit = gains[_LIMIT + i]
        rates[i] = min(limit, max(-limit, rate))


@jit
def _inverse(q: np.ndarray) -> np.ndarray:
    out = -q
    out[0] = q[0]
    return out


@jit
def _z_axis(q: np.ndarray) -> np.ndarray:
    """Return the third column (3,) of the rotation matrix of q (4,)."""
    out = np.empty(3)
    out[0] = 2.0 * (q[0] * q[2] + q[1] * q[3])
    out[1] = 2.0 * (q[2] * q[3] - q[0] * q[1])
    out[2] = q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3]
    return out


@jit
def _shortest(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,) that turns a (3,) into b (3,), both of unit norm."""
    q = np.empty(4)
    q[0] = 1.0 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    q[1] = a[1] * b[2] - a[2] * b[1]
    q[2] = a[2] * b[0] - a[0] * b[2]
    q[3] = a[0] * b[1] - a[1] * b[0]
    if q[1] * q[1] + q[2] * q[2] + q[3] * q[3] < _PARALLEL * _PARALLEL and q[0] < 1.0:
        # a half turn about an axis perpendicular to a: here a x (unit vector of its smallest entry)
        smallest = np.zeros(3)
        smallest[np.argmin(np.abs(a))] = 1.0
        q[0] = 0.0
        q[1] = a[1] * smallest[2] - a[2] * smallest[1]
        q[2] = a[2] * smallest[0] - a[0] * smallest[2]
        q[3] = a[0] * smallest[1] - a[1] * smallest[0]
    return q / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
