"""Jitter of the motion capture: wrong stamps, and a slow wander beside the white noise."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from uam_sim_bridge.plant.effects.effect import Acting, Bench, Effect, Pose, size


class MocapJitter(Effect):
    """The stamps of the poses have errors, and the position wanders slowly."""

    SOURCE: ClassVar[str] = (
        "stamps of the receiver instead of the cameras: vrpn_mocap, byu-magicc/optitrack_vrpn; "
        "noise that is not white: Skurowski and Pawlyta 2019, doi 10.3390/s19204435; sizes: "
        "assumptions"
    )

    stamp: float = size("standard deviation of the stamp's error", "s", 0.0, 0.01)
    wander: float = size("standard deviation of the slow position error", "m", 0.0, 0.02)
    wander_time: float = size("its correlation time", "s", 0.01, 1000.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        rate = bench.vehicle.numbers["sensors"]["mocap"]["rate"]
        return _Jitter(self, noise, math.exp(-1.0 / (rate * self.wander_time)))


class _Jitter(Acting):
    def __init__(self, p: MocapJitter, noise: np.random.Generator, keep: float) -> None:
        self._noise, self._keep = noise, keep
        self._step, self._stamp = p.wander * math.sqrt(1.0 - keep * keep), p.stamp
        self._error = p.wander * noise.standard_normal(3)
        self._last = -math.inf

    def pose(self, pose: Pose) -> Pose:
        drawn = self._noise.standard_normal(4)
        self._error = self._keep * self._error + self._step * drawn[:3]
        # stamps of one receiver never go back
        stamp = max(0.0, pose[0] + self._stamp * float(drawn[3]), self._last + 1e-6)
        self._last = stamp
        return stamp, pose[1] + self._error, pose[2]
