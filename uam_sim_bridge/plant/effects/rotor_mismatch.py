"""Rotors that are not what the vehicle file says: thrust, reaction torque, lags and curve."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uam_sim_bridge.plant.effects.effect import Bench, Effect, each, size


class RotorMismatch(Effect):
    """Thrust, reaction torque, lags and idle speed of the rotors are not the vehicle file's."""

    SOURCE: ClassVar[str] = (
        "six flights and a thrust stand of the T650, FSC-Lab: thrust 0.93 to 1.04 of what its "
        "allocator believes, reaction torque / thrust 0.76 of it [fit, wb 1.1-1.6]"
    )

    thrust: tuple[float, ...] = each(
        "thrust / the vehicle file's, for each rotor or for all", "1", 0.5, 1.5
    )
    yaw: float = size("reaction torque per thrust / the vehicle file's", "1", 0.0, 3.0)
    lag_up: float = size("time constant while speeding up / the vehicle file's", "1", 0.1, 10.0)
    lag_down: float = size("the same while slowing down", "1", 0.1, 10.0)
    idle: float = size(
        "speed at command 0 / full speed, linear between; 0: the vehicle file's curve",
        "1",
        0.0,
        0.5,
    )

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        rotors, count = bench.rotors, len(bench.rotors.speed)
        rotors.efficiency *= bench.for_each("rotor_mismatch: thrust", self.thrust, count, "rotors")
        rotors.scale_lags(np.array([[self.lag_up], [self.lag_down]]))
        if self.idle > 0.0:
            rotors.turn_linearly(self.idle)
        for name in bench.vehicle.description.rotor_names:
            bench.model.actuator(name).gear[5] *= self.yaw
