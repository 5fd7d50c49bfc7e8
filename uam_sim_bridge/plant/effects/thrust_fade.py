"""Thrust that falls with the time since lift-off, as flights show it: no model of a battery."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size

LEAST = 0.3  # [1] part of the thrust that is left at the end


class ThrustFade(Effect):
    """The thrust at the same command falls with the time since lift-off."""

    SOURCE: ClassVar[str] = (
        "six flights of the T650, FSC-Lab: 2.6 to 4.5 % a minute, 3.6 % in its plant [wb 1.1]"
    )

    per_minute: float = size("part of the thrust that is lost in a minute", "1/min", 0.0, 0.5)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        described = bench.vehicle.description
        weight, loss = described.mass * described.gravity, self.per_minute / 60.0 * bench.period
        arrays = FadeArrays(bench.rotors.thrust, bench.lift, np.ones(1), weight, loss)
        return Compiled(arrays, tick=fade)


class FadeArrays(NamedTuple):
    """thrust (rotors,) [N], lift (rotors,): see `Bench`; part (1,): of the thrust that is left;
    weight [N]: from which thrust on it falls; loss: in a tick."""

    thrust: np.ndarray
    lift: np.ndarray
    part: np.ndarray
    weight: float
    loss: float


@borrowing
def fade(a: FadeArrays) -> int:
    """Take the loss of a tick from the thrust, from lift-off on."""
    total = 0.0
    for thrust in a.thrust:
        total += thrust
    if a.part[0] < 1.0 or total > a.weight:
        a.part[0] = max(LEAST, a.part[0] - a.loss)
    for i in range(len(a.lift)):
        a.lift[i] *= a.part[0]
    return 0
