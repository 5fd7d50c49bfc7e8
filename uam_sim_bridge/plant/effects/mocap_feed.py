"""A motion capture that is not the vehicle file's: rate, noise and delay."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uam_control.vehicle.plant_numbers import LARGEST_RATE, LEAST_RATE
from uam_sim_bridge.plant.effects.effect import Bench, Effect, size


class MocapFeed(Effect):
    """Rate, noise and delay of the motion capture are not the vehicle file's.

    Above the rate of the ticks several poses are taken in a tick, each of its own time.
    """

    SOURCE: ClassVar[str] = (
        "FSC-Lab: 60 Hz, 0.5 mm [wb 1.1-1.6]; OptiTrack: 30 to 360 Hz; laboratory: that of the "
        "vehicle file but the noise, which is FSC-Lab's"
    )

    rate: float = size("of the poses", "Hz", LEAST_RATE, LARGEST_RATE)
    position_noise: float = size("standard deviation of a pose", "m", 0.0, 0.1)
    attitude_noise: float = size("the same about each axis", "rad", 0.0, 0.2)
    latency: float = size("from exposure to arrival", "s", 0.0, 0.5)

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        scale = bench.vehicle.numbers["sensors"]["noise_scale"]
        noises = scale * self.position_noise, scale * self.attitude_noise
        bench.mocap.feed(self.rate, round(self.latency / bench.period), noises)
