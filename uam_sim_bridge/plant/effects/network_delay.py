"""Delay of the networks: of setpoints and other messages to the autopilot, and of mocap poses.

Each packet needs a fixed time and an exponentially distributed one, up to a longest time. Packets
do not overtake each other. The setpoint path is not part of the plant: the bridge's transport and
the direct engine use `SetpointDelay`, whose delay depends on seed and tick only, so that both
engines have the same.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.settings.json_text import read_mapping
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Effect, size
from uam_sim_bridge.plant.sensors import Noise, next_row

BLOCK = 4096  # draws per call of the generator; the sequence is the same for any


class NetworkDelay(Effect):
    """Setpoints reach the autopilot later, and poses the companion computer."""

    SOURCE: ClassVar[str] = (
        "setpoints: p50 4 ms and p99 12 ms, measured on this stack with PX4 v1.16 paced by the "
        "wall clock; poses: the same shape on Wi-Fi, assumption"
    )

    setpoint: float = size("fixed delay of messages to the autopilot", "s", 0.0, 0.2)
    setpoint_jitter: float = size("mean of the added delay", "s", 0.0, 0.1)
    mocap: float = size("fixed delay added to the poses", "s", 0.0, 0.2)
    mocap_jitter: float = size("mean of the added delay", "s", 0.0, 0.1)
    longest: float = size("longest added delay of both", "s", 0.0, 0.5)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        return _PoseDelay(self, bench, noise)


@borrowing
def delay(a: tuple) -> int:
    """Add to the delay of the newest pose: its status, added delays [s], the fixed and longest."""
    status, added, fixed, longest = a
    status[0].late += fixed + min(longest, added.rows[next_row(added), 0])
    return 0


class _PoseDelay(Acting):
    STEPS: ClassVar = {"pose": delay}

    def __init__(self, p: NetworkDelay, bench: Bench, noise: np.random.Generator) -> None:
        self.noises = (Noise(noise, np.array([p.mocap_jitter]), "standard_exponential"),)
        self.arrays = bench.memory, self.noises[0].arrays, p.mocap, p.longest


class SetpointDelay:
    """Delay of the messages to the autopilot; all messages of a tick are equally late."""

    def __init__(self, fixed: float, jitter: float, longest: float, seed: int) -> None:
        """fixed, jitter, longest: see `NetworkDelay` [s]; seed: of the flight."""
        self._numbers = {"fixed": fixed, "jitter": jitter, "longest": longest, "seed": seed}
        self._fixed, self._jitter, self._longest = fixed, jitter, longest
        self._noise = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0x5E7,)))
        self._draws = iter(())
        self._time, self._late = -1.0, fixed  # [s] newest tick, its delay

    @classmethod
    def of(cls, effects: Mapping[str, Mapping[str, float]], seed: int) -> Self | None:
        """Return the delay of the plant's effects; None without `network_delay`."""
        values = effects.get(NetworkDelay.NAME)
        if not values:
            return None
        p = NetworkDelay.from_mapping(dict(values))
        return cls(p.setpoint, p.setpoint_jitter, p.longest, seed)

    @classmethod
    def from_text(cls, text: str) -> Self | None:
        """Return the delay that `to_text` wrote; None for an empty text. Raises ValueError."""
        if not text:
            return None
        refusal = f"network_delay: {text[:80]!r} is not valid"
        try:
            return cls(**read_mapping(text, ValueError, refusal))
        except TypeError:
            raise ValueError(refusal) from None

    def to_text(self) -> str:
        """Return it as text for a parameter."""
        return json.dumps(self._numbers)

    def at(self, time: float) -> float:
        """Return the delay [s] of the messages of the tick `time` [s]; ticks in order of time."""
        if time > self._time:
            self._time = time
            self._late = self._fixed + min(self._longest, self._jitter * self._drawn())
        return self._late

    def _drawn(self) -> float:
        value = next(self._draws, None)
        if value is None:
            self._draws = iter(self._noise.standard_exponential(BLOCK).tolist())
            value = next(self._draws)
        return value
