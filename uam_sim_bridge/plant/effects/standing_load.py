"""A force and a torque that stand still: what flights show and no model explains."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, several, size
from uam_sim_bridge.plant.vehicle import BASE


class StandingLoad(Effect):
    """A constant force and a constant torque act on the base, at its centre of mass."""

    SOURCE: ClassVar[str] = (
        "six flights of the T650, FSC-Lab: force 0.74 N on 3.75 kg, constant in the body on "
        "circles, torque -0.07 to -0.13 N m about z [wb 1.1-1.6]; laboratory: the same per mass"
    )

    force: tuple[float, ...] = several("x, y, z", "N", -20.0, 20.0)
    torque: tuple[float, ...] = several("about x, y, z", "N m", -5.0, 5.0)
    turning: float = size("1: both turn with the body (FLU), 0: they do not (ENU)", "1", 0.0, 1.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        applied = bench.data.xfrc_applied[bench.model.body(BASE).id]
        load = np.array([self.force, self.torque])
        return Compiled(LoadArrays(applied, bench.base_axes, load, self.turning), tick=press)


class LoadArrays(NamedTuple):
    """applied (6,) [N, N m, ENU]: on the base, the force already with the drag; axes (9,): body →
    world, row by row; load (2, 3); turning: 0 to 1, its part in the body's axes."""

    applied: np.ndarray
    axes: np.ndarray
    load: np.ndarray
    turning: float


@borrowing
def press(a: LoadArrays) -> int:
    """Add the force to that on the base; set the torque."""
    for i in range(3):
        a.applied[3 + i] = 0.0
        for kind in range(2):
            value = (1.0 - a.turning) * a.load[kind, i]
            for k in range(3):
                value += a.turning * a.axes[3 * i + k] * a.load[kind, k]
            a.applied[3 * kind + i] += value
    return 0
