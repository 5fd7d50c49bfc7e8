"""Poses of all parts of the vehicle: the plant's MJCF model set to a row of the series."""

from __future__ import annotations

import mujoco
import numpy as np

from uam_control.maths.rotations import quaternion_from_euler
from uam_lab.results.timeseries import COLUMNS, Series
from uam_sim_bridge.plant.vehicle import Vehicle

CHI = slice(COLUMNS["truth.x"], COLUMNS["truth.x"] + 8)
PAYLOAD = COLUMNS.block("payload.")
SWING = COLUMNS["magnet.swing"]
OUT_OF_SIGHT = (50.0, 50.0, -1.0)


class Poses:
    """A MuJoCo model with its data, which can be set to any recorded state."""

    def __init__(self, series: Series, vehicle: Vehicle | None = None):
        mass = series.info.get("payload_mass_kg") or 0.0
        self.series = series
        self.vehicle = vehicle or Vehicle.load(series.info.get("vehicle") or "s500_arm")
        self.model = self.vehicle.compile(mass)
        self.data = mujoco.MjData(self.model)
        self.has_payload = mass > 0.0 and not np.isnan(series["payload.x"]).all()
        joint = self.model.joint
        self._base, self._payload = (joint(n).qposadr[0] for n in ("base", "payload"))
        self._arm = joint("alpha_1").qposadr[0]
        self._swing = joint("magnet_swing").qposadr[0]

    def put(self, row: int) -> None:
        """Set the model to the pose in `row` of the series."""
        values, qpos = self.series.values[row], self.data.qpos
        chi = values[CHI]
        qpos[self._base : self._base + 3] = chi[:3]
        qpos[self._base + 3 : self._base + 7] = quaternion_from_euler(chi[3:6])
        qpos[self._arm : self._arm + 2] = chi[6:8]
        qpos[self._swing] = np.nan_to_num(values[SWING])
        payload = values[PAYLOAD]
        if not self.has_payload or np.isnan(payload).any():
            payload = (*OUT_OF_SIGHT, 1.0, 0.0, 0.0, 0.0)
        qpos[self._payload : self._payload + 7] = payload
        mujoco.mj_kinematics(self.model, self.data)

    def body(self, name: str) -> np.ndarray:
        """Return the world position (3,) [m] of a body's frame."""
        return self.data.body(name).xpos.copy()

    def site(self, name: str) -> np.ndarray:
        """Return the world position (3,) [m] of a site."""
        return self.data.site(name).xpos.copy()
