"""Dropouts of the motion capture: single poses and short bursts are lost."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uam_sim_bridge.plant.effects.effect import Acting, Bench, Effect, Pose, size


class MocapDropouts(Effect):
    """Single poses are lost, and now and then all of them for some hundredths of a second."""

    SOURCE: ClassVar[str] = (
        "UDP without repetition over Wi-Fi, one packet per pose; sizes: assumptions (0.5 % of the "
        "poses, one burst of 50 ms in 20 s)"
    )

    share: float = size("share of the poses lost singly", "1", 0.0, 0.9)
    bursts: float = size("bursts per time", "1/s", 0.0, 10.0)
    burst_time: float = size("mean length of a burst (exponential)", "s", 0.0, 1.0)
    longest: float = size("longest burst", "s", 0.0, 2.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        return _Dropouts(self, noise, bench.vehicle.numbers["sensors"]["mocap"]["rate"])


class _Dropouts(Acting):
    def __init__(self, p: MocapDropouts, noise: np.random.Generator, rate: float) -> None:
        self._p, self._noise, self._begins = p, noise, p.bursts / rate
        self._until = -1.0  # [s]

    def pose(self, pose: Pose) -> Pose | None:
        lost, begins = self._noise.random(2)
        length = min(self._p.longest, self._p.burst_time * self._noise.standard_exponential())
        if pose[0] < self._until:
            return None
        if begins < self._begins:
            self._until = pose[0] + length
            return None
        return None if lost < self._p.share else pose
