"""The vehicle's data: its MJCF and the numbers around it, read from config/vehicle/."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import yaml

from uam_control.settings.configuration import path


@dataclass
class Vehicle:
    """Numbers of config/vehicle/<name>.yaml and the MJCF that it names."""

    numbers: dict
    model_path: Path

    @classmethod
    def load(cls, name: str = "s500_arm") -> Vehicle:
        """Read a vehicle by name; raises what `configuration.path` raises for an unknown one."""
        file = path(f"vehicle/{name}.yaml")
        numbers = yaml.safe_load(file.read_text())
        return cls(numbers, file.parent / numbers["model"])

    def changed(self, changes: dict[str, object]) -> Vehicle:
        """Return a copy with dotted entries replaced, e.g. {"air.gust": 1.0}."""
        numbers = deepcopy(self.numbers)
        for dotted, value in changes.items():
            *parents, last = dotted.split(".")
            entry = numbers
            for parent in parents:
                entry = entry[parent]
            if last not in entry:
                raise KeyError(f"vehicle has no '{dotted}'")
            entry[last] = value
        return Vehicle(numbers, self.model_path)

    @property
    def thrust_max(self) -> float:
        """Largest thrust of one rotor [N]."""
        rotors = self.numbers["rotors"]
        return rotors["thrust_coefficient"] * rotors["speed_max"] ** 2

    def compile(
        self, payload_mass: float, extend: Callable[[mujoco.MjSpec], None] | None = None
    ) -> mujoco.MjModel:
        """Return the MuJoCo model with a payload of payload_mass [kg] (0: far away, massless).

        extend: adds to the model what only some flights need.
        """
        spec = mujoco.MjSpec.from_file(str(self.model_path))
        spec.geom("payload").mass = max(payload_mass, 1e-3)
        if extend is not None:
            extend(spec)
        model = spec.compile()
        self._vary(model)
        return model

    def _vary(self, model: mujoco.MjModel) -> None:
        """Give vehicle and arm the masses of `variation`."""
        variation = self.numbers["variation"]
        if variation["mass"] == 1.0 and variation["inertia"] == 1.0:
            return
        own = np.arange(model.nbody) != model.body("payload").id
        model.body_mass[own] *= variation["mass"]
        model.body_inertia[own] *= variation["mass"] * variation["inertia"]
        mujoco.mj_setConst(model, mujoco.MjData(model))
