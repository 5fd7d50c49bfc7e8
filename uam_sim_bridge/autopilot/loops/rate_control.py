"""The body-rate loop, with PX4's structure (v1.16: VehicleAngularVelocity, RateControl).

    gyro → low pass (Butterworth, 2nd order, IMU_GYRO_CUTOFF) → rates
    rates → difference → low pass (1st order, IMU_DGYRO_CUTOFF) → angular acceleration
    torque = K (P error + D (-angular acceleration)) + FF setpoint + integral, normalised, FRD
    yaw torque → low pass (1st order, MC_YAW_TQ_CUTOFF)

The integral does not grow in the direction of a torque that the motors do not make. Its gain
decreases to 0 at an error of 400 deg/s. It is limited, held while landed and zero while disarmed.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import borrowing

# rows of `memory` (7, 3), the state of the loop
DELAY_1, DELAY_2, RATES, ACCELERATION, INTEGRAL, TORQUE, UNALLOCATED = range(7)
# rows of `gains` (5, 3)
P, I, D, FF, LIMIT = range(5)  # noqa: E741
# entries of `filters` (7,)
B0, B1, B2, A1, A2, ACCELERATION_ALPHA, YAW_ALPHA = range(7)

FULL_INTEGRATION_ERROR = math.radians(400.0)  # the integral's gain reaches 0 here (PX4)


def filter_coefficients(
    sample_rate: float, gyro_cutoff: float, acceleration_cutoff: float, yaw_cutoff: float
) -> np.ndarray:
    """Return `filters` (7,) for a sample rate and three cut-offs [Hz]; 0: no filter."""
    filters = np.zeros(7)
    filters[: A2 + 1] = butterworth(sample_rate, gyro_cutoff)
    filters[ACCELERATION_ALPHA] = alpha(sample_rate, acceleration_cutoff)
    filters[YAW_ALPHA] = alpha(sample_rate, yaw_cutoff)
    return filters


def butterworth(sample_rate: float, cutoff: float) -> tuple[float, float, float, float, float]:
    """Return b0, b1, b2, a1, a2 of a 2nd-order Butterworth low pass (bilinear transform, a0 = 1).

    A cut-off [Hz] of 0 or at and above half the sample rate passes the signal unchanged (PX4).
    """
    if not 0.0 < cutoff < sample_rate / 2.0:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    w = math.tan(math.pi * cutoff / sample_rate)
    scale = 1.0 / (1.0 + math.sqrt(2.0) * w + w * w)
    b0 = w * w * scale
    return (
        b0,
        2.0 * b0,
        b0,
        2.0 * (w * w - 1.0) * scale,
        (1.0 - math.sqrt(2.0) * w + w * w) * scale,
    )


def alpha(sample_rate: float, cutoff: float) -> float:
    """Return the weight of a new sample in a 1st-order low pass; 1 (no filter) for cut-off 0."""
    if cutoff <= 0.0:
        return 1.0
    dt = 1.0 / sample_rate
    return dt / (dt + 1.0 / (2.0 * math.pi * cutoff))


@borrowing
def filter_gyro(gyro: np.ndarray, dt: float, filters: np.ndarray, memory: np.ndarray) -> None:
    """Advance DELAY_1, DELAY_2, RATES, ACCELERATION of memory (7, 3) by one sample.

    gyro (3,) [rad/s, FRD]; dt [s]; filters (7,): `filter_coefficients`.
    """
    for axis in range(3):
        d1 = memory[DELAY_1, axis]
        d2 = memory[DELAY_2, axis]
        d0 = gyro[axis] - filters[A1] * d1 - filters[A2] * d2
        rate = filters[B0] * d0 + filters[B1] * d1 + filters[B2] * d2
        memory[DELAY_2, axis] = d1
        memory[DELAY_1, axis] = d0
        slope = (rate - memory[RATES, axis]) / dt
        memory[ACCELERATION, axis] += filters[ACCELERATION_ALPHA] * (
            slope - memory[ACCELERATION, axis]
        )
        memory[RATES, axis] = rate


def reset_filters(gyro: np.ndarray, filters: np.ndarray, memory: np.ndarray) -> None:
    """Set the filters' state in memory (7, 3) to a constant gyro (3,) [rad/s, FRD]."""
    gain = 1.0 + filters[A1] + filters[A2]
    memory[DELAY_1] = memory[DELAY_2] = np.asarray(gyro) / gain
    memory[RATES] = gyro
    memory[ACCELERATION] = 0.0


@borrowing
def rate_torque(
    setpoint: np.ndarray,
    dt: float,
    filters: np.ndarray,
    gains: np.ndarray,
    landed: bool,
    memory: np.ndarray,
) -> None:
    """Advance TORQUE and INTEGRAL of memory (7, 3): normalised torques, FRD.

    setpoint (>= 3,): desired body rates [rad/s, FRD] first; dt [s]; filters (7,); gains (5, 3):
    rows P, I, D (times K), FF, LIMIT; landed: the integral is held.
    """
    for axis in range(3):
        error = setpoint[axis] - memory[RATES, axis]
        torque = (
            gains[P, axis] * error
            + memory[INTEGRAL, axis]
            - gains[D, axis] * memory[ACCELERATION, axis]
            + gains[FF, axis] * setpoint[axis]
        )
        if axis == 2:
            torque = memory[TORQUE, 2] + filters[YAW_ALPHA] * (torque - memory[TORQUE, 2])
        memory[TORQUE, axis] = torque
        if landed:
            continue
        if memory[UNALLOCATED, axis] > 0.0:
            error = min(error, 0.0)
        elif memory[UNALLOCATED, axis] < 0.0:
            error = max(error, 0.0)
        ratio = error / FULL_INTEGRATION_ERROR
        growth = max(0.0, 1.0 - ratio * ratio) * gains[I, axis] * error * dt
        limit = gains[LIMIT, axis]
        memory[INTEGRAL, axis] = min(limit, max(-limit, memory[INTEGRAL, axis] + growth))
