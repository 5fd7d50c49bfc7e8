"""Spread of rotors and ESCs: no two of them are equal."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uam_sim_bridge.plant.effects.effect import Bench, Effect, size

LIMIT = 2.5  # [1] a draw is at most so many standard deviations away: worse parts are exchanged


class RotorSpread(Effect):
    """Rotors differ in thrust at the same command, motors and ESCs in their time constants."""

    SOURCE: ClassVar[str] = (
        "thrust: 10-inch propellers and 5010 motors of one batch on a thrust stand differ by some "
        "per cent (assumption, 3 %); lag: assumption, 10 %"
    )

    thrust: float = size("standard deviation of the thrust factor", "1", 0.0, 0.2)
    lag: float = size("standard deviation of the factor on the time constants", "1", 0.0, 0.3)

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        rotors = bench.rotors
        drawn = np.clip(noise.standard_normal((2, len(rotors.speed))), -LIMIT, LIMIT)
        rotors.efficiency *= 1.0 + self.thrust * drawn[0]
        rotors.scale_lags(1.0 + self.lag * drawn[1])
