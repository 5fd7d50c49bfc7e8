"""Poses of all parts of the vehicle: the plant's MJCF model set to a row of the series."""

from __future__ import annotations

import mujoco
import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_control.maths.rotations import quaternion_from_euler
from uam_control.vehicle import DEFAULT_VEHICLE
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.plant.gripper import FINGERS
from uam_sim_bridge.plant.surroundings import PAYLOAD, PLACE
from uam_sim_bridge.plant.vehicle import BASE, ENVIRONMENT, SWING, Vehicle

OUT_OF_SIGHT = (50.0, 50.0, -1.0)


class Poses:
    """A MuJoCo model with its data, which can be set to any recorded state."""

    def __init__(self, series: Series):
        mass = series.info.get("payload_mass_kg") or 0.0
        self.series = series
        around = {key: series.info[key] for key in (ENVIRONMENT,) if key in series.info}
        vehicle = Vehicle.load(series.info.get("vehicle") or DEFAULT_VEHICLE)
        self.vehicle = vehicle.changed(around)
        self.model = self.vehicle.compile(mass)
        self.data = mujoco.MjData(self.model)
        self.has_payload = mass > 0.0 and not np.isnan(series["payload.x"]).all()
        joint = self.model.joint
        self._base, self._payload = (joint(n).qposadr[0] for n in (BASE, PAYLOAD))
        self._arm = joint(self.vehicle.description.joint_names[0]).qposadr[0]
        magnet = self.vehicle.description.has_magnet
        self._swing = joint(SWING).qposadr[0] if magnet else None
        hand = FINGERS if "gripper.opening" in series.columns else ()
        self._fingers = [joint(name).qposadr[0] for name in hand]

    def put(self, row: int) -> None:
        """Set the model to the pose in `row` of the series."""
        columns, values, qpos = self.series.columns, self.series.values[row], self.data.qpos
        chi = values[columns.block("truth.")][: columns.size]
        qpos[self._base : self._base + 3] = chi[POSITION]
        qpos[self._base + 3 : self._base + 7] = quaternion_from_euler(chi[ATTITUDE])
        qpos[self._arm : self._arm + columns.joints] = chi[ARM]
        if self._swing is not None:
            qpos[self._swing] = np.nan_to_num(values[columns["magnet.swing"]])
        if self._fingers:
            qpos[self._fingers] = 0.5 * np.nan_to_num(values[columns["gripper.opening"]])
        payload = values[columns.block("payload.")]
        if not self.has_payload or np.isnan(payload).any():
            payload = (*OUT_OF_SIGHT, 1.0, 0.0, 0.0, 0.0)
        qpos[self._payload : self._payload + 7] = payload
        mujoco.mj_kinematics(self.model, self.data)

    @property
    def outermost_rotors(self) -> tuple[str, str]:
        """Names of the rearmost and the foremost rotor."""
        rotors = self.vehicle.description.rotors
        ends = (pick(rotors, key=lambda rotor: rotor.position[0]) for pick in (min, max))
        return tuple(rotor.name for rotor in ends)

    def arm(self) -> list[np.ndarray]:
        """Return the world positions (3,) [m] of the joints, base to tip."""
        names = self.vehicle.description.joint_names
        return [self.data.joint(name).xanchor.copy() for name in names]

    def geoms(self, beginning: str) -> np.ndarray:
        """Return the world positions (m, 3) [m] of the geoms whose names begin so."""
        names = [self.model.geom(i).name for i in range(self.model.ngeom)]
        found = [i for i, name in enumerate(names) if name.startswith(beginning)]
        return self.data.geom_xpos[found].copy()

    def scenery(self) -> list[str]:
        """Return the names of the geoms that stand around the vehicle."""
        model, place = self.model, self.model.body(PLACE).id
        above = model.body_parentid[model.geom_bodyid]
        return [model.geom(i).name for i in np.flatnonzero(above == place)]

    def body(self, name: str) -> np.ndarray:
        """Return the world position (3,) [m] of a body's frame."""
        return self.data.body(name).xpos.copy()

    def site(self, name: str) -> np.ndarray:
        """Return the world position (3,) [m] of a site."""
        return self.data.site(name).xpos.copy()
