"""Noise of the servos' current loops: their torque is not quite the commanded one.

White noise through a first-order low-pass, exact for any step: its standard deviation does not
depend on the step.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, each, size
from uam_sim_bridge.plant.sensors import Noise, NoiseArrays, next_row


class ServoNoise(Effect):
    """The torque of the servos has noise of their current loops."""

    SOURCE: ClassVar[str] = (
        "XM430-W350 on a bench, FSC-Lab [srv]: 6 to 10 mA rms, 15 to 24 mN m, 5 Hz; laboratory: "
        "its 10 mA at the torque per current of the XM430-W210, 1.3 N m/A"
    )

    torque: tuple[float, ...] = each(
        "standard deviation, for each joint or for all", "N m", 0.0, 0.5
    )
    bandwidth: float = size("of the noise", "Hz", 0.1, 100.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        count, keep = bench.arm[1], math.exp(-2.0 * math.pi * self.bandwidth * bench.period)
        sizes = bench.for_each("servo_noise: torque", self.torque, count, "joints")
        white = Noise(noise, math.sqrt(1.0 - keep * keep) * sizes)
        arrays = TorqueNoise(bench.torque_control, white.arrays, np.zeros(count), keep)
        return Compiled(arrays, [white], tick=renew, joints=add)


class TorqueNoise(NamedTuple):
    """torque (n,) [N m]: on the joints; white (n,) [N m]: new part in a tick; noise (n,) [N m]: the
    present one; keep: of it from tick to tick."""

    torque: np.ndarray
    white: NoiseArrays
    noise: np.ndarray
    keep: float


@borrowing
def renew(a: TorqueNoise) -> int:
    """Advance the noise by a tick."""
    drawn = a.white.rows[next_row(a.white)]
    for i in range(len(a.noise)):
        a.noise[i] = a.keep * a.noise[i] + drawn[i]
    return 0


@borrowing
def add(a: TorqueNoise) -> int:
    """Add the noise to the torques."""
    for i in range(len(a.noise)):
        a.torque[i] += a.noise[i]
    return 0
