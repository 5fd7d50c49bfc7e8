"""Vibration of the propellers in the IMU: harmonics of the rotor speeds, through the frame.

An unbalanced rotor pushes the frame with m e omega^2, turning in the rotor's plane (first
harmonic). The blades make the thrust vary at the blade-passing frequency, twice the rotor speed for
two blades. Each force accelerates the frame as a rigid body, by F / m and r x F / I; resonances of
the frame multiply both by `frame_gain`. An IMU sample is the mean over the control period, as PX4
integrates its IMU (IMU_INTEG_RATE): the harmonics above half the sample rate do not alias back.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import jit
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Effect, size

BLADES = 2


class PropellerVibration(Effect):
    """Unbalanced propellers and blade passing shake the IMU through the frame."""

    SOURCE: ClassVar[str] = (
        "rigid-body mechanics; imbalance as ISO 21940 grade G 16 of 50 g; frame_gain so that the "
        "accelerometer shows about 1 m/s^2 RMS after PX4's integration"
    )

    imbalance: float = size("mean static imbalance of a rotor", "kg m", 0.0, 1e-3)
    blade_passing: float = size("amplitude at twice the rotor speed / thrust", "1", 0.0, 0.5)
    frame_gain: float = size("resonance of the frame, factor on both", "1", 0.0, 50.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        rotors = len(bench.positions)
        spread = self.imbalance * np.abs(1.0 + 0.3 * noise.standard_normal(rotors))
        phases = noise.uniform(0.0, 2.0 * math.pi, rotors)
        return _Vibration(self, bench, spread, phases)


class _Vibration(Acting):
    def __init__(
        self, p: PropellerVibration, bench: Bench, imbalance: np.ndarray, phases: np.ndarray
    ) -> None:
        model, base = bench.model, bench.model.body("base").id
        self._rotors = bench.rotors
        self._shaken = Shaken(
            bench.directions,
            bench.positions,
            phases,
            imbalance,
            p.blade_passing * bench.vehicle.description.rotor.thrust_coefficient,
            p.frame_gain / float(model.body_subtreemass[base]),
            p.frame_gain / model.body_inertia[base],
            bench.period,
        )

    def imu(self, gyro: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return vibrated(gyro, force, self._rotors.speed, self._shaken)


class Shaken(NamedTuple):
    """Rotors and frame.

    directions (rotors,): 1 counter-clockwise; positions (rotors, 3) [m, FLU]; phases (rotors,)
    [rad]: their state; imbalance (rotors,) [kg m]; blade [N s^2/rad^2]: amplitude of the thrust /
    speed^2; mass: frame gain / mass [1/kg]; inertia (3,): frame gain / inertia [1/(kg m^2)]; period
    [s]: of a sample.
    """

    directions: np.ndarray
    positions: np.ndarray
    phases: np.ndarray
    imbalance: np.ndarray
    blade: float
    mass: float
    inertia: np.ndarray
    period: float


@jit
def mean_of_wave(phase: float, angle: float) -> tuple[float, float]:
    """Return the means of cos and sin over the phases from `phase` to `phase + angle` [rad]."""
    if abs(angle) < 1e-6:
        return math.cos(phase), math.sin(phase)
    end = phase + angle
    cosine = (math.sin(end) - math.sin(phase)) / angle
    return cosine, (math.cos(phase) - math.cos(end)) / angle


@jit
def vibrated(
    gyro: np.ndarray, force: np.ndarray, speed: np.ndarray, shaken: Shaken
) -> tuple[np.ndarray, np.ndarray]:
    """Return gyro (3,) [rad/s] and specific force (3,) [m/s^2], FLU, with the vibration.

    speed (rotors,) [rad/s]. The phases advance by one period.
    """
    directions, positions, phases, imbalance, blade, mass, inertia, period = shaken
    rates, acceleration = gyro.copy(), force.copy()
    for i in range(len(speed)):
        omega = speed[i]
        if omega < 1.0:
            continue
        angle = omega * period
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        cosine, sine = mean_of_wave(phases[i], angle)
        across = imbalance[i] * omega * omega
        fx, fy = across * cosine, across * directions[i] * sine
        cosine2, sine2 = mean_of_wave(BLADES * phases[i], BLADES * angle)
        up = blade * omega * omega
        acceleration[0] += mass * fx
        acceleration[1] += mass * fy
        acceleration[2] += mass * up * cosine2
        # body rates are the integrals of torque / inertia: divided by the frequency, 90 deg behind
        gx, gy = across * sine / omega, -across * directions[i] * cosine / omega
        gz = up * sine2 / (BLADES * omega)
        rates[0] += inertia[0] * (y * gz - z * gy)
        rates[1] += inertia[1] * (z * gx - x * gz)
        rates[2] += inertia[2] * (x * gy - y * gx)
        phases[i] = (phases[i] + angle) % (2.0 * math.pi)
    return rates, acceleration
