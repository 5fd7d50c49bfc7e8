"""Jitter of the motion capture: wrong stamps, and a slow wander beside the white noise."""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size
from uam_sim_bridge.plant.sensors import Noise, NoiseArrays, next_row


class MocapJitter(Effect):
    """The stamps of the poses have errors, and the position wanders slowly."""

    SOURCE: ClassVar[str] = (
        "stamps of the receiver instead of the cameras: vrpn_mocap, byu-magicc/optitrack_vrpn; "
        "noise that is not white: Skurowski and Pawlyta 2019, doi 10.3390/s19204435; sizes: "
        "assumptions"
    )

    stamp: float = size("standard deviation of the stamp's error", "s", 0.0, 0.01)
    wander: float = size("standard deviation of the slow position error", "m", 0.0, 0.02)
    wander_time: float = size("its correlation time", "s", 0.01, 1000.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        keep = math.exp(-bench.mocap.period / self.wander_time)
        error = self.wander * noise.standard_normal(3)
        step = self.wander * math.sqrt(1.0 - keep * keep)
        drawn = Noise(noise, np.array([step, step, step, self.stamp]))
        arrays = JitterArrays(bench.pose, drawn.arrays, error, np.full(1, -np.inf), keep)
        return Compiled(arrays, [drawn], pose=jitter)


class JitterArrays(NamedTuple):
    """pose: of `Bench`; noise: of the wander (3,) [m] and of a stamp [s]; error (3,) [m]: the
    wander; last (1,) [s]: newest stamp; keep: of the wander from pose to pose."""

    pose: np.ndarray
    noise: NoiseArrays
    error: np.ndarray
    last: np.ndarray
    keep: float


@borrowing
def jitter(a: JitterArrays) -> int:
    """Change stamp and position of the newest pose; stamps of one receiver never go back."""
    drawn = a.noise.rows[next_row(a.noise)]
    for i in range(3):
        a.error[i] = a.keep * a.error[i] + drawn[i]
        a.pose[1 + i] += a.error[i]
    a.pose[0] = max(0.0, a.pose[0] + drawn[3], a.last[0] + 1e-6)
    a.last[0] = a.pose[0]
    return 0
