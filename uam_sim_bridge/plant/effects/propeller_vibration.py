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

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size
from uam_sim_bridge.plant.vehicle import BASE

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
        rotors, model = len(bench.positions), bench.model
        spread = self.imbalance * np.abs(1.0 + 0.3 * noise.standard_normal(rotors))
        phases, base = noise.uniform(0.0, 2.0 * math.pi, rotors), model.body(BASE).id
        arrays = Shaken(
            *(bench.sample, bench.rotors.speed, bench.directions, bench.positions),
            *(phases, spread),
            self.blade_passing * bench.vehicle.description.rotor.thrust_coefficient,
            self.frame_gain / float(model.body_subtreemass[base]),
            self.frame_gain / model.body_inertia[base],
            bench.period,
        )
        return Compiled(arrays, sample=vibrate)


class Shaken(NamedTuple):
    """Rotors and frame.

    sample: see `Bench`; speed (rotors,) [rad/s]; directions (rotors,): 1 counter-clockwise;
    positions (rotors, 3) [m, FLU]; phases (rotors,) [rad]: their state; imbalance (rotors,) [kg m];
    blade [N s^2/rad^2]: amplitude of the thrust / speed^2; mass: frame gain / mass [1/kg]; inertia
    (3,): frame gain / inertia [1/(kg m^2)]; period [s]: of a sample.
    """

    sample: np.ndarray
    speed: np.ndarray
    directions: np.ndarray
    positions: np.ndarray
    phases: np.ndarray
    imbalance: np.ndarray
    blade: float
    mass: float
    inertia: np.ndarray
    period: float


@borrowing
def mean_of_wave(phase: float, angle: float) -> tuple[float, float]:
    """Return the means of cos and sin over the phases from `phase` to `phase + angle` [rad]."""
    if abs(angle) < 1e-6:
        return math.cos(phase), math.sin(phase)
    end = phase + angle
    cosine = (math.sin(end) - math.sin(phase)) / angle
    return cosine, (math.cos(phase) - math.cos(end)) / angle


@borrowing
def vibrate(a: Shaken) -> int:
    """Add the vibration to gyro and specific force; the phases advance by one period."""
    sample, inertia = a.sample, a.inertia
    for i in range(len(a.speed)):
        omega = a.speed[i]
        if omega < 1.0:
            continue
        angle = omega * a.period
        x, y, z = a.positions[i, 0], a.positions[i, 1], a.positions[i, 2]
        cosine, sine = mean_of_wave(a.phases[i], angle)
        across = a.imbalance[i] * omega * omega
        fx, fy = across * cosine, across * a.directions[i] * sine
        cosine2, sine2 = mean_of_wave(BLADES * a.phases[i], BLADES * angle)
        up = a.blade * omega * omega
        sample[3] += a.mass * fx
        sample[4] += a.mass * fy
        sample[5] += a.mass * up * cosine2
        # body rates are the integrals of torque / inertia: divided by the frequency, 90 deg behind
        gx, gy = across * sine / omega, -across * a.directions[i] * cosine / omega
        gz = up * sine2 / (BLADES * omega)
        sample[0] += inertia[0] * (y * gz - z * gy)
        sample[1] += inertia[1] * (z * gx - x * gz)
        sample[2] += inertia[2] * (x * gy - y * gx)
        a.phases[i] = (a.phases[i] + angle) % (2.0 * math.pi)
    return 0
