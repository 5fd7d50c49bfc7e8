"""Normalised torques and thrust → four motor thrusts, as PX4's control allocator does it.

The mixer is the pseudo-inverse of the rotors' effectiveness, its columns scaled so that the size of
the vehicle and of the rotors drops out (PX4: pseudo-inverse with normalised roll, pitch, yaw):
roll and pitch by the same factor, such that the columns have the norm sqrt(n/2) for n rotors; yaw
such that its largest entry is 1; thrust such that all entries are 1. Saturation is removed in the
order of importance (PX4: sequential desaturation, MC_AIRMODE = 0): collective down, then roll and
pitch, then yaw with a margin, then collective down again.

Motor order and signs are PX4's quad X: front-right CCW, back-left CCW, front-left CW,
back-right CW; torques FRD.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.compiled import jit

ROLL, PITCH, YAW, THRUST = range(4)
YAW_MARGIN = 0.15  # of the motor range, kept for yaw at full thrust (PX4: minimum yaw margin)
WEAK = 0.2  # mixer entries below this do not desaturate (PX4)


def effectiveness(px: np.ndarray, py: np.ndarray, moment_ratio: np.ndarray) -> np.ndarray:
    """Return (4, n): rows roll, pitch, yaw torque [N m] and thrust [N] per newton of each rotor.

    px, py (n,) [m]: rotor positions forward and right; moment_ratio (n,) [m]: reaction torque per
    newton, positive for a counter-clockwise rotor seen from above (CA_ROTORn_PX, _PY, _KM).
    """
    return np.stack([-np.asarray(py), np.asarray(px), np.asarray(moment_ratio), np.ones(len(px))])


def normalised_mixer(px: np.ndarray, py: np.ndarray, moment_ratio: np.ndarray) -> np.ndarray:
    """Return (n, 4): motor thrust 0..1 per unit of normalised roll, pitch, yaw, thrust.

    Raises ValueError where the rotors cannot make the four of them independently.
    """
    matrix = effectiveness(px, py, moment_ratio)
    if np.linalg.matrix_rank(matrix) < 4:
        raise ValueError("the rotor geometry cannot make roll, pitch, yaw and thrust independently")
    mixer = np.linalg.pinv(matrix)
    used = np.count_nonzero(np.abs(mixer) > 1e-3, axis=0)
    norms = np.linalg.norm(mixer, axis=0)
    mixer[:, :YAW] /= max(norms[axis] / math.sqrt(used[axis] / 2.0) for axis in (ROLL, PITCH))
    mixer[:, YAW] /= mixer[:, YAW].max()
    mixer[:, THRUST] /= np.abs(mixer[:, THRUST]).mean()
    mixer[np.abs(mixer) < 1e-3] = 0.0
    return np.ascontiguousarray(mixer)


def torque_scale(
    px: np.ndarray, py: np.ndarray, moment_ratio: np.ndarray, rotor_thrust: float
) -> np.ndarray:
    """Return (3,) [N m]: the torque about each axis for a normalised torque of 1.

    rotor_thrust [N]: thrust of one rotor at motor thrust 1.
    """
    matrix = effectiveness(px, py, moment_ratio)
    return rotor_thrust * np.diag(matrix @ normalised_mixer(px, py, moment_ratio))[:3].copy()


@jit
def _desaturate(
    motors: np.ndarray, mixer: np.ndarray, axis: int, upper: float, down_only: bool
) -> None:
    """Move `motors` along one mixer column so that the sum of both saturations gets smallest."""
    for attempt in range(2):
        low = 0.0
        high = 0.0
        for i in range(motors.shape[0]):
            entry = mixer[i, axis]
            if abs(entry) < WEAK:
                continue
            step = 0.0
            if motors[i] < 0.0:
                step = -motors[i] / entry
            elif motors[i] > upper:
                step = (upper - motors[i]) / entry
            low = min(low, step)
            high = max(high, step)
        gain = low + high
        if attempt == 0 and down_only and gain > 0.0:
            return
        if attempt == 1:
            gain *= 0.5  # the second pass settles half of what the first one left
        for i in range(motors.shape[0]):
            motors[i] += gain * mixer[i, axis]


@jit
def allocate(torque: np.ndarray, thrust: float, mixer: np.ndarray, motors: np.ndarray) -> None:
    """Write the motor thrusts 0..1 into `motors` (n,).

    torque (3,): normalised, FRD; thrust: normalised collective, up; mixer: `normalised_mixer`.
    """
    count = motors.shape[0]
    for i in range(count):
        motors[i] = (
            mixer[i, ROLL] * torque[0] + mixer[i, PITCH] * torque[1] + mixer[i, THRUST] * thrust
        )
    _desaturate(motors, mixer, THRUST, 1.0, True)
    _desaturate(motors, mixer, ROLL, 1.0, False)
    _desaturate(motors, mixer, PITCH, 1.0, False)
    for i in range(count):
        motors[i] += mixer[i, YAW] * torque[2]
    _desaturate(motors, mixer, YAW, 1.0 + YAW_MARGIN, False)
    _desaturate(motors, mixer, THRUST, 1.0, True)
    for i in range(count):
        motors[i] = min(1.0, max(0.0, motors[i]))


@jit
def unallocated_torque(
    torque: np.ndarray, motors: np.ndarray, inverse_mixer: np.ndarray, out: np.ndarray
) -> None:
    """Write into out (3,) the part of `torque` that `motors` do not make (normalised).

    inverse_mixer (4, n): pseudo-inverse of the normalised mixer. All three are zero where the sum
    of squares is below 1e-6, as in PX4's allocator status.
    """
    total = 0.0
    for axis in range(3):
        made = 0.0
        for i in range(motors.shape[0]):
            made += inverse_mixer[axis, i] * motors[i]
        out[axis] = torque[axis] - made
        total += out[axis] * out[axis]
    if total < 1e-6:
        for axis in range(3):
            out[axis] = 0.0
