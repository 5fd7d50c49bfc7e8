"""Delay of the networks: of setpoints and other messages to the autopilot, and of mocap poses.

Each packet needs a fixed time and an exponentially distributed one, up to a longest time. Packets
do not overtake each other. The setpoint path is not part of the plant: the bridge's transport and
the direct engine use `SetpointDelay`, whose delay depends on seed and tick only, so that both
engines have the same.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import NamedTuple, Self

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import record
from uam_control.settings.json_text import read_mapping
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size
from uam_sim_bridge.plant.sensors import Noise, NoiseArrays, next_row


class NetworkDelay(Effect):
    """Setpoints reach the autopilot later, and poses the companion computer."""

    SOURCE = (
        "setpoints: p50 4 ms and p99 12 ms, measured on this stack with PX4 v1.16 paced by the "
        "wall clock; poses: the same shape on Wi-Fi, assumption"
    )

    setpoint: float = size("fixed delay of messages to the autopilot", "s", 0.0, 0.2)
    setpoint_jitter: float = size("mean of the added delay", "s", 0.0, 0.1)
    mocap: float = size("fixed delay added to the poses", "s", 0.0, 0.2)
    mocap_jitter: float = size("mean of the added delay", "s", 0.0, 0.1)
    longest: float = size("longest added delay of both", "s", 0.0, 0.5)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        added = Noise(noise, np.array([self.mocap_jitter]), "standard_exponential")
        arrays = bench.memory, added.arrays, self.mocap, self.longest
        return Compiled(arrays, [added], pose=delay)


@borrowing
def delay(a: tuple) -> int:
    """Add to the delay of the newest pose: its status, added delays [s], the fixed and longest."""
    status, added, fixed, longest = a
    status[0].late += fixed + min(longest, added.rows[next_row(added), 0])
    return 0


class DelayArrays(NamedTuple):
    """added: noise [s]; numbers (1,): now [s], the newest tick, late [s], its delay, fixed, longest
    [s]."""

    added: NoiseArrays
    numbers: np.ndarray


class SetpointDelay:
    """Delay of the messages to the autopilot; all messages of a tick are equally late."""

    def __init__(self, fixed: float, jitter: float, longest: float, seed: int) -> None:
        """fixed, jitter, longest: see `NetworkDelay` [s]; seed: of the flight."""
        self._numbers = {"fixed": fixed, "jitter": jitter, "longest": longest, "seed": seed}
        noise = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0x5E7,)))
        self._added = Noise(noise, np.array([jitter]), "standard_exponential")
        memory = record("", "now late fixed longest")
        memory[0] = -1.0, fixed, fixed, longest
        self.arrays = DelayArrays(self._added.arrays, memory)
        self._at = bound(late_at, self.arrays, 0.0)

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

    def draw(self) -> int:
        """Draw the noise that is due; return for how many ticks it lasts."""
        return self._added.draw()

    def at(self, time: float) -> float:
        """Return the delay [s] of the messages of the tick `time` [s]; ticks in order of time."""
        self._added.draw()
        return self._at(time)


@borrowing
def late_at(a: DelayArrays, time: float) -> float:
    """See `SetpointDelay.at`."""
    m = a.numbers[0]
    if time > m.now:
        m.now = time
        m.late = m.fixed + min(m.longest, a.added.rows[next_row(a.added), 0])
    return m.late
