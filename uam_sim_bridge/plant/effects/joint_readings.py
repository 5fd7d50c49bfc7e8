"""What the servos say of their joints: speeds late and in whole units, angles in counts."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size


class JointReadings(Effect):
    """The servos report their speed late, and angle and speed in coarse units."""

    SOURCE: ClassVar[str] = (
        "XM430-W350 of FSC-Lab: present velocity 44 to 56 ms late [wb 2.7, arm]; units: ROBOTIS "
        "e-manual"
    )

    delay: float = size("of the speed", "s", 0.0, 0.2)
    speed_unit: float = size("quantum of the speed", "rad/s", 1e-4, 0.5)
    counts: float = size("counts of the encoder per turn", "1", 64.0, 1048576.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        n, ticks = bench.arm[1], round(self.delay / bench.period)
        bench.encoder_units[:] = 2.0 * np.pi / self.counts, self.speed_unit
        speeds = bench.sample[6 + n : 6 + 2 * n]
        arrays = SpeedArrays(speeds, np.zeros((ticks + 1, n)), np.zeros(1, dtype=np.int64))
        return Compiled(arrays, sample=hold_back)


class SpeedArrays(NamedTuple):
    """speeds (n,) [rad/s]: as taken; earlier (ticks + 1, n): of the last ticks, in a ring; next
    (1,): its row."""

    speeds: np.ndarray
    earlier: np.ndarray
    next: np.ndarray


@borrowing
def hold_back(a: SpeedArrays) -> int:
    """Exchange the speeds of a tick for those that are reported at it."""
    row = a.next[0]
    following = (row + 1) % len(a.earlier)
    for i in range(len(a.speeds)):
        a.earlier[row, i] = a.speeds[i]
        a.speeds[i] = a.earlier[following, i]
    a.next[0] = following
    return 0
