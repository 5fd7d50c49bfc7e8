"""Dropouts of the motion capture: single poses and short bursts are lost."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size
from uam_sim_bridge.plant.sensors import Noise, NoiseArrays, next_row


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
        shares, lengths = noise.spawn(2)
        noises = (
            Noise(shares, np.ones(2), "random"),
            Noise(lengths, np.array([self.burst_time]), "standard_exponential"),
        )
        arrays = DropoutArrays(
            bench.pose,
            *(one.arrays for one in noises),
            *(bench.memory, np.full(1, -1.0)),
            *(self.share, self.bursts * bench.mocap.period, self.longest),
        )
        return Compiled(arrays, noises, pose=drop)


class DropoutArrays(NamedTuple):
    """pose: of `Bench`; shares: uniform noise, lengths [s]: of bursts; status (1,): of `Bench`;
    until (1,) [s]: end of the burst; share, begins: parts of the poses, longest [s]."""

    pose: np.ndarray
    shares: NoiseArrays
    lengths: NoiseArrays
    status: np.ndarray
    until: np.ndarray
    share: float
    begins: float
    longest: float


@borrowing
def drop(a: DropoutArrays) -> int:
    """Lose the newest pose, or not."""
    drawn = a.shares.rows[next_row(a.shares)]
    length = min(a.longest, a.lengths.rows[next_row(a.lengths), 0])
    in_burst = a.pose[0] < a.until[0]
    if not in_burst and drawn[1] < a.begins:
        a.until[0] = a.pose[0] + length
        in_burst = True
    if in_burst or drawn[0] < a.share:
        a.status[0].lost = 1
    return 0
