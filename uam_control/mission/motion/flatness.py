"""Differential flatness of the base: its attitude follows from the motion of position and yaw.

The thrust must make the force f = m (p_ddot + g e3 + d p_dot), with d the linear drag per mass. Its
direction gives roll and pitch by eq. (4a), pos; jerk and snap give their derivatives. Source:
Faessler, Franchi, Scaramuzza 2018, "Differential flatness of quadrotor dynamics subject to rotor
drag"; here the drag acts along the world axes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.coordinates import (
    ATTITUDE,
    CHI,
    CHI_DDOT,
    CHI_DOT,
    JERK,
    PITCH,
    POSITION,
    ROLL,
    SNAP,
    YAW,
    X,
    Y,
    Z,
)
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import thrust_attitude
from uam_control.vehicle import VehicleDescription, VehicleError, chain_and_hinge


@jit
def write_reference(
    motion: np.ndarray,
    drag: np.ndarray,
    gravity: float,
    rate_max: float,
    acceleration_max: float,
    reference: np.ndarray,
) -> None:
    """Write the motion, with roll, pitch and their two derivatives, into reference (3, 6 + n).

    motion (5, 6 + n): see `coordinates`; drag (3,): linear drag per mass along the world axes
    [1/s]; gravity [m/s^2]; rate_max [rad/s] and acceleration_max [rad/s^2] bound the derivatives
    of motions with steps in acceleration or jerk. The angles are Euler angles of the body (Z-Y-X)
    [rad].
    """
    for row in range(reference.shape[0]):
        for i in range(reference.shape[1]):
            reference[row, i] = motion[row, i]
    # f / m and its derivatives
    f, f_dot, f_ddot = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        f[i] = motion[CHI_DDOT, i] + drag[i] * motion[CHI_DOT, i]
        f_dot[i] = motion[JERK, i] + drag[i] * motion[CHI_DDOT, i]
        f_ddot[i] = motion[SNAP, i] + drag[i] * motion[JERK, i]
    f[Z] += gravity
    yaw, rate, acceleration = motion[CHI, YAW], motion[CHI_DOT, YAW], motion[CHI_DDOT, YAW]
    c, s = math.cos(yaw), math.sin(yaw)
    # ahead, aside: the force along the heading and to its right; d/dt of c is -s rate
    ahead, aside = c * f[X] + s * f[Y], s * f[X] - c * f[Y]
    ahead_1, aside_1 = c * f_dot[X] + s * f_dot[Y], s * f_dot[X] - c * f_dot[Y]
    ahead_2, aside_2 = c * f_ddot[X] + s * f_ddot[Y], s * f_ddot[X] - c * f_ddot[Y]
    ahead_dot, aside_dot = ahead_1 - rate * aside, aside_1 + rate * ahead
    ahead_ddot = ahead_2 - 2.0 * rate * aside_1 - acceleration * aside - rate * rate * ahead
    aside_ddot = aside_2 + 2.0 * rate * ahead_1 + acceleration * ahead - rate * rate * aside
    # pitch = atan2(ahead, up); roll = atan2(aside, across), across^2 = ahead^2 + up^2
    up, up_dot, up_ddot = f[Z], f_dot[Z], f_ddot[Z]
    across = math.sqrt(ahead * ahead + up * up)
    if across < 1e-3 * gravity:  # free fall has no attitude: level
        reference[:, ROLL] = 0.0
        reference[:, PITCH] = 0.0
        return
    across_dot = (ahead * ahead_dot + up * up_dot) / across
    across_ddot = (
        ahead_dot * ahead_dot + ahead * ahead_ddot + up_dot * up_dot + up * up_ddot
        - across_dot * across_dot
    ) / across  # fmt: skip
    write_angle(aside, aside_dot, aside_ddot, across, across_dot, across_ddot, reference[:, ROLL])
    write_angle(ahead, ahead_dot, ahead_ddot, up, up_dot, up_ddot, reference[:, PITCH])
    for i in (ROLL, PITCH):
        reference[CHI_DOT, i] = min(rate_max, max(-rate_max, reference[CHI_DOT, i]))
        reference[CHI_DDOT, i] = min(
            acceleration_max, max(-acceleration_max, reference[CHI_DDOT, i])
        )


def attitudes(force: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Return roll, pitch, yaw (m, 3) [rad] of force (m, 3) [N, or per mass] and yaw (m,) [rad]."""
    angles = np.empty((len(yaw), 3))
    _write_attitudes(np.ascontiguousarray(force), np.ascontiguousarray(yaw), angles)
    return angles


@jit
def _write_attitudes(force: np.ndarray, yaw: np.ndarray, angles: np.ndarray) -> None:
    for i in range(len(yaw)):
        angles[i, 0], angles[i, 1] = thrust_attitude(force[i], yaw[i])
        angles[i, 2] = yaw[i]


@jit
def write_angle(
    a: float, a_dot: float, a_ddot: float, b: float, b_dot: float, b_ddot: float, rows: np.ndarray
) -> None:
    """Write atan2(a, b) and its first and second derivative to rows (3,)."""
    square = a * a + b * b
    turn = a_dot * b - a * b_dot
    rows[CHI] = math.atan2(a, b)
    rows[CHI_DOT] = turn / square
    rows[CHI_DDOT] = (a_ddot * b - a * b_ddot) / square - turn * 2.0 * (a * a_dot + b * b_dot) / (
        square * square
    )


class Flyer(NamedTuple):
    """A vehicle with an end effector, as far as its flatness goes."""

    chain: Chain
    gravity: float  # [m/s^2]
    drag: np.ndarray  # (3,) linear, per mass, along the world axes [1/s]
    hinge: tuple[float, float] = (-math.inf, math.inf)  # [rad] of the hand, lowest and highest

    @classmethod
    def of(cls, vehicle: VehicleDescription) -> Flyer:
        """Return that of a vehicle. Raises VehicleError, also for one without an end effector."""
        chain, hinge = chain_and_hinge(vehicle)
        if not chain.has_hand:
            raise VehicleError(f"{vehicle.file}: the vehicle has no end effector")
        drag = np.array(vehicle.numbers["air"]["drag"]) / vehicle.mass
        return cls(chain, vehicle.gravity, drag, hinge)

    @classmethod
    def with_hand(cls, vehicle: VehicleDescription) -> Flyer | None:
        """Return that of a vehicle, None for one without an end effector."""
        try:
            return cls.of(vehicle)
        except VehicleError:
            return None


def flattened(rows: np.ndarray, flyer: Flyer) -> np.ndarray:
    """Write the attitude that the acceleration of rows (3, m, 6 + n) needs into their angles.

    Return the force (m, 3) of the rotors per mass [m/s^2].
    """
    force = rows[CHI_DDOT, :, POSITION] + flyer.drag * rows[CHI_DOT, :, POSITION]
    force[:, Z] += flyer.gravity
    rows[CHI, :, ATTITUDE] = attitudes(force, rows[CHI, :, YAW])
    return force
