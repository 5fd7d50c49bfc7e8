"""The effects that act in a flight, and what they do at each tick."""

from __future__ import annotations

import zlib
from collections.abc import Mapping

import numpy as np

from uam_sim_bridge.plant.effects.catalogue import EFFECTS
from uam_sim_bridge.plant.effects.effect import HOOKS, Acting, Bench, Pose


def generator(seed: int, name: str) -> np.random.Generator:
    """Return the generator of the effect `name`: it does not depend on the other effects."""
    return np.random.default_rng(
        np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()),))
    )


class ActingEffects:
    """The effects of a flight; `bench.lift` (rotors,) is the factor on the rotors' thrust."""

    def __init__(self, effects: Mapping[str, Mapping[str, float]], bench: Bench, seed: int) -> None:
        """effects: name → parameters, see `presets.read`; seed: of the flight."""
        self.bench = bench
        made: list[Acting] = []
        for name, kind in EFFECTS.items():
            if name in effects:
                one = kind.from_mapping(dict(effects[name])).begin(bench, generator(seed, name))
                if one is not None:
                    made.append(one)
        ticks, joints, imus, poses, late = (
            [one for one in made if getattr(type(one), hook) is not getattr(Acting, hook)]
            for hook in HOOKS
        )
        self._ticks, self._imus, self._poses, self._late = ticks, imus, poses, late
        self.gears = tuple(joints)  # effects of the joints, at each physics step

    def tick(self) -> None:
        """Set the loads and factors of the next control period."""
        self.bench.lift[:] = 1.0
        for one in self._ticks:
            one.tick()

    def imu(self, gyro: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sample of the IMU: gyro (3,) [rad/s], specific force (3,) [m/s^2], FLU."""
        for one in self._imus:
            gyro, force = one.imu(gyro, force)
        return gyro, force

    def pose(self, pose: Pose) -> tuple[Pose | None, int]:
        """Return the mocap pose, None for a lost one, and its added delay in ticks."""
        ticks = round(sum(one.lateness() for one in self._late) / self.bench.period)
        changed: Pose | None = pose
        for one in self._poses:
            if changed is not None:
                changed = one.pose(changed)
        return changed, ticks
