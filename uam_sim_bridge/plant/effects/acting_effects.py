"""The effects that act in a flight, and what they do at each tick."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from uam_control.maths.kept_tuple import Hook, compiled_hook, python_hook, table
from uam_sim_bridge.plant.effects.catalogue import EFFECTS
from uam_sim_bridge.plant.effects.effect import HOOKS, Acting, Bench
from uam_sim_bridge.plant.sensors import BLOCK


def generator(seed: int, name: str) -> np.random.Generator:
    """Return the generator of the effect `name`: it does not depend on the other effects."""
    return np.random.default_rng(
        np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()),))
    )


class EffectArrays(NamedTuple):
    """What the compiled tick has of the effects. Hooks (k, 2): see `hooks.table`."""

    tick: np.ndarray  # hooks, as the next three
    joints: np.ndarray
    sample: np.ndarray
    pose: np.ndarray
    lift: np.ndarray  # (rotors,) of `Bench`
    row: np.ndarray  # `sample` of `Bench`
    factor: np.ndarray  # (rotors,) on the thrust without `lift`
    numbers: np.ndarray  # (1,) lost, late of `Bench`


class ActingEffects:
    """The effects of a flight on its plant; `acting`: those that act in it, by name."""

    def __init__(self, effects: Mapping[str, Mapping], bench: Bench, seed: int) -> None:
        """effects: name → parameters, see `presets.read`; seed: of the flight."""
        self.bench, self.acting = bench, dict[str, Acting]()
        self._errors: list[BaseException] = []
        for name, kind in EFFECTS.items():
            if name in effects:
                one = kind.from_mapping(dict(effects[name])).begin(bench, generator(seed, name))
                if one is not None:
                    self.acting[name] = one
        self._noises = [noise for one in self.acting.values() for noise in one.noises]
        hooks = {name: self._hooks(name) for name in HOOKS}
        self.compiled = all(one.steps for one in self.acting.values())  # none is in Python
        self._kept = hooks
        tables = (table(hooks[name]) for name in HOOKS)
        factor = bench.rotors.efficiency.copy()
        self.arrays = EffectArrays(*tables, bench.lift, bench.sample, factor, bench.memory)

    def _hooks(self, name: str) -> list[Hook]:
        found = []
        for one in self.acting.values():
            if name in one.steps:
                found.append(compiled_hook(one.steps[name], one.arrays))
            elif not one.steps and (function := self._in_python(one, name)):
                found.append(python_hook(self._safe(function)))
        return found

    def _in_python(self, one: Acting, hook: str) -> Callable[[], None] | None:
        """Return what an effect in Python does at a hook; None for nothing."""
        own = {
            name for name in dir(Acting) if getattr(type(one), name) is not getattr(Acting, name)
        }
        if hook in ("tick", "joints"):
            return getattr(one, hook) if hook in own else None
        if hook == "sample":
            return (lambda: self._change_imu(one)) if "imu" in own else None
        return (lambda: self._change_pose(one)) if own & {"pose", "lateness"} else None

    def _change_imu(self, one: Acting) -> None:
        row = self.bench.sample
        row[0:3], row[3:6] = one.imu(row[0:3].copy(), row[3:6].copy())

    def _change_pose(self, one: Acting) -> None:
        bench = self.bench
        bench.late += one.lateness()
        if bench.lost:
            return
        pose = bench.pose.copy()
        changed = one.pose((pose.item(0), pose[1:4], pose[4:]))
        if changed is None:
            bench.lost = True
        else:
            bench.pose[:] = changed[0], *changed[1], *changed[2]

    def _safe(self, function: Callable[[], None]) -> Callable[[], int]:
        """Return the function without its errors: compiled code that calls it cannot pass them."""

        def safe() -> int:
            try:
                function()
            except Exception as error:
                self._errors.append(error)
            return 0

        return safe

    def check(self) -> None:
        """Raise the first error of an effect in Python."""
        if self._errors:
            raise self._errors[0]

    def draw(self) -> int:
        """Draw the noise that is due; return for how many ticks it lasts."""
        poses = math.ceil(self.bench.period / self.bench.mocap.period)  # in a tick
        return min((noise.draw(poses) for noise in self._noises), default=BLOCK) // poses
