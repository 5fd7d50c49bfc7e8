"""Normalised torques and thrust → motor thrusts, as in PX4's control allocator.

The mixer is `rotor_geometry.normalised_mixer`. Saturation is removed in this order (PX4: sequential
desaturation, MC_AIRMODE = 0): collective down, then roll and pitch, then yaw with a margin, then
collective down again.

Motor order and signs are those of PX4's CA_ROTORn; torques FRD.
"""

from __future__ import annotations

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.vehicle.rotor_geometry import PITCH, ROLL, THRUST, YAW

YAW_MARGIN = 0.15  # of the motor range, kept for yaw at full thrust (PX4: minimum yaw margin)
WEAK = 0.2  # mixer entries below this do not desaturate (PX4)


@borrowing
def _desaturate(
    motors: np.ndarray, mixer: np.ndarray, axis: int, upper: float, down_only: bool
) -> None:
    """Move motors (n,) along one mixer column to remove saturation, or balance it at both ends."""
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
            gain *= 0.5  # the second pass removes half of the remaining saturation
        for i in range(motors.shape[0]):
            motors[i] += gain * mixer[i, axis]


@borrowing
def allocate(torque: np.ndarray, thrust: float, mixer: np.ndarray, motors: np.ndarray) -> None:
    """Write the motor thrusts 0..1 into `motors` (n,).

    torque (3,): normalised, FRD; thrust: normalised collective, up; mixer (n, 4):
    `normalised_mixer`.
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


@borrowing
def unallocated_torque(
    torque: np.ndarray, motors: np.ndarray, inverse_mixer: np.ndarray, out: np.ndarray
) -> None:
    """Write into out (3,) the part of torque (3,) that motors (n,) do not make; normalised, FRD.

    inverse_mixer (4, n): pseudo-inverse of the normalised mixer. All three are zero if the sum of
    squares is below 1e-6, as in PX4's allocator status.
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
