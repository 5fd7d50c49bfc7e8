"""Magnetometer and barometer of HIL_SENSOR, from the true state plus seeded noise.

The control laws use neither sensor. PX4 requires both: its data validator reports a sensor with a
constant value as failed.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.rotations import matrix_from_quaternion, rotate_back

FIELD = np.array([0.2150, 0.0100, 0.4250])  # gauss, NED: about the Earth's field at 47 deg north
ORIGIN_ALTITUDE = 488.0  # m above sea level
TEMPERATURE = 20.0  # deg C
_MAG_NOISE = 0.002  # gauss
_PRESSURE_NOISE = 0.01  # hPa, about 8 cm

# International Standard Atmosphere, troposphere
_SEA_PRESSURE, _SEA_TEMPERATURE, _LAPSE, _EXPONENT = 1013.25, 288.15, 0.0065, 5.25588


def pressure_at(altitude: float) -> float:
    """Return the static pressure [hPa] at an altitude [m] above sea level."""
    return _SEA_PRESSURE * (1.0 - _LAPSE * altitude / _SEA_TEMPERATURE) ** _EXPONENT


def altitude_of(pressure: float) -> float:
    """Return the pressure altitude [m] of a static pressure [hPa]: inverse of pressure_at."""
    return _SEA_TEMPERATURE / _LAPSE * (1.0 - (pressure / _SEA_PRESSURE) ** (1.0 / _EXPONENT))


class SlowSensors:
    """Magnetometer and barometer, both updated at 50 Hz."""

    def __init__(self, seed: int) -> None:
        self._noise = np.random.default_rng(seed)

    def magnetometer(self, quaternion_ned: np.ndarray) -> list[float]:
        """Return the field (3,) [gauss, FRD]; quaternion_ned (4,): attitude FRD → NED [w x y z]."""
        field = rotate_back(matrix_from_quaternion(quaternion_ned), FIELD)
        return (field + self._noise.normal(0.0, _MAG_NOISE, 3)).tolist()

    def barometer(self, height: float) -> tuple[float, float]:
        """Return pressure [hPa] and pressure altitude [m] at `height` [m] above the origin."""
        pressure = pressure_at(ORIGIN_ALTITUDE + height) + self._noise.normal(0.0, _PRESSURE_NOISE)
        return (pressure, altitude_of(pressure)) if math.isfinite(pressure) else (0.0, 0.0)
