"""Torque of the cables that cross the joints: a spring towards the pose in which they were laid."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uam_sim_bridge.plant.effects.effect import Acting, Bench, Effect, size


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
        return _CableTorque(bench, stiffness, rest)


class _CableTorque(Acting):
    def __init__(self, bench: Bench, stiffness: np.ndarray, rest: np.ndarray) -> None:
        dofs = bench.arm_dofs
        start = bench.model.jnt_qposadr[bench.model.dof_jntid[dofs.start]]
        self._alpha = bench.data.qpos[start : start + bench.arm[1]]
        self._torque = bench.data.qfrc_applied[dofs]
        self._stiffness, self._rest = stiffness, rest

    def tick(self) -> None:
        np.multiply(self._stiffness, self._rest - self._alpha, out=self._torque)
