"""Masses, inertias and a centre of mass that are not the vehicle file's."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uam_sim_bridge.plant.effects.effect import Bench, Effect, several, size
from uam_sim_bridge.plant.vehicle import vary


class MassMismatch(Effect):
    """Masses, inertias and centre of mass of base and arm are not the vehicle file's."""

    SOURCE: ClassVar[str] = (
        "stress plant of the T650, FSC-Lab, its config A: base and inertia 1.1, arm 1.05, "
        "10, 10 and 5 mm; laboratory: half of them, an assumption: scales weigh to 1 %"
    )

    base: float = size("mass of the base / the vehicle file's", "1", 0.5, 2.0)
    inertia: float = size("inertia of the base / the vehicle file's", "1", 0.3, 3.0)
    arm: float = size("mass and inertia of the arm / the vehicle file's", "1", 0.5, 2.0)
    shift: tuple[float, ...] = several("of the base's centre of mass: x, y, z", "m", -0.1, 0.1)

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        vary(bench.model, (self.base, self.arm), (self.inertia / self.base, 1.0), self.shift)
