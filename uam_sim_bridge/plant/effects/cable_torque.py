"""Torque of the cables that cross the joints: a spring towards the pose in which they were laid."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size


class CableTorque(Effect):
    """The cables along the arm pull each joint towards its stowed angle."""

    SOURCE: ClassVar[str] = (
        "assumption: one servo cable and the magnet's two wires in a loop of some 5 cm; "
        "0.02 N m/rad is 1 % of the servo's stall torque at 90 deg"
    )

    stiffness: float = size("torque per angle", "N m/rad", 0.0, 0.5)
    stiffness_spread: float = size("standard deviation / stiffness, per flight", "1", 0.0, 1.0)
    rest_spread_deg: float = size("standard deviation of the rest angle, per flight", "deg", 0, 45)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        joints = bench.arm[1]
        drawn = noise.standard_normal((2, joints))
        stiffness = self.stiffness * np.abs(1.0 + self.stiffness_spread * drawn[0])
        rest = bench.vehicle.description.stowed + np.radians(self.rest_spread_deg) * drawn[1]
        torque = bench.data.qfrc_applied[bench.arm_dofs]
        return Compiled((torque, bench.angles, stiffness, rest), tick=pull)


@borrowing
def pull(a: tuple) -> int:
    """Set the torques (n,) [N m] of springs: their angles, stiffnesses and rest angles (n,)."""
    torque, angles, stiffness, rest = a
    for i in range(len(torque)):
        torque[i] = stiffness[i] * (rest[i] - angles[i])
    return 0
