"""The true M(chi), C(chi, chi_dot) chi_dot and g(chi) along a flight, computed by MuJoCo.

Eq. (1), EL_dynamics: M chi_ddot + C chi_dot + g + d = tau, chi = (p, q, alpha).

Coordinates. This stack uses quasi-velocities for the attitude (docs/law.md): chi_dot[ATTITUDE] are
the body rates Omega (FLU), chi_ddot[ATTITUDE] is their derivative, tau_q is a torque in FLU.
MuJoCo's free joint uses the same: qvel = (velocity in the world, angular velocity in the body).
MuJoCo's mass matrix and bias force therefore need no change of coordinates. With body rates the
equations are those of Boltzmann and Hamel; C chi_dot is still quadratic in chi_dot.

The magnet hangs on a passive pivot, which the paper's arm does not have. M, C and g are computed
with the pivot fixed at its recorded angle; the force of its recorded motion is `pivot`, a part of
the paper's d. The payload is part of the magnet while the magnet carries it. M contains the
reflected inertia of the servos (armature). Friction, drag and contacts are not in M, C, g.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from uam_control.coordinates import ALPHA, ATTITUDE, CHI, CHI_DOT, POSITION
from uam_control.maths.rotations import quaternion_from_euler
from uam_lab.analysis import tracking
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.vehicle import MAGNET, PAYLOAD


@dataclass(frozen=True)
class Dynamics:
    """True dynamics at m ticks. Forces in the order of chi: N, world (p), N m, FLU (q), N m."""

    mass: np.ndarray  # (m, 6 + n, 6 + n)
    coriolis: np.ndarray  # (m, 6 + n) C chi_dot
    gravity: np.ndarray  # (m, 6 + n) g
    pivot: np.ndarray  # (m, 6 + n) force of the swinging magnet; part of d
    carrying: np.ndarray  # (m,) payload on the magnet

    def required(self, acceleration: np.ndarray) -> np.ndarray:
        """Return M chi_ddot + C chi_dot + g (m, 6 + n), units as above, for chi_ddot (m, 6 + n)."""
        return np.einsum("kij,kj->ki", self.mass, acceleration) + self.coriolis + self.gravity


class Body:
    """MuJoCo model of the vehicle, with or without the payload fixed to its magnet."""

    def __init__(
        self,
        vehicle: Vehicle,
        payload_mass: float = 0.0,
        payload_position: np.ndarray = (0.0, 0.0, -0.0505),
    ) -> None:
        """payload_mass [kg]: at the magnet, or without one at the end effector; payload_position
        (3,) [m]: centre, in the frame of the magnet."""

        def hold_payload(spec: mujoco.MjSpec) -> None:
            described = vehicle.description
            holder, place = spec.body(MAGNET), payload_position
            if not described.has_magnet and described.end_effector:
                hand = spec.site(described.end_effector)
                holder, place = hand.parent, hand.pos
            if payload_mass > 0.0 and holder is not None:
                holder.add_geom(
                    name="held",
                    type=mujoco.mjtGeom.mjGEOM_BOX,
                    size=np.array(spec.geom(PAYLOAD).size),
                    pos=np.array(place, dtype=float),
                    mass=payload_mass,
                )

        # the free payload is a tree of its own, which is not evaluated
        self.rotor_names = vehicle.description.rotor_names
        self.size = len(vehicle.description.coordinates)  # base and arm; a pivot follows them
        self.pivot = vehicle.description.has_magnet
        self.model = model = vehicle.compile(0.0, hold_payload)
        flags = mujoco.mjtDisableBit
        model.opt.disableflags |= flags.mjDSBL_CONSTRAINT | flags.mjDSBL_CONTACT
        model.opt.enableflags = 0  # no sleeping
        self.data = mujoco.MjData(model)
        self.data.qpos[model.joint(PAYLOAD).qposadr[0]] = 50.0

    def place(self, chi: np.ndarray, swing: float = math.nan) -> None:
        """Set the pose: chi (6 + n,) [m, world; rad, Euler angles; rad, joints], pivot [rad].

        NaN: the pivot hangs.
        """
        qpos = self.data.qpos
        qpos[0:3] = chi[POSITION]
        qpos[3:7] = quaternion_from_euler(chi[ATTITUDE])
        qpos[7 : self.size + 1] = chi[ALPHA:]
        if self.pivot:
            qpos[self.size + 1] = self._hanging() if math.isnan(swing) else swing

    def _hanging(self) -> float:
        """Return the angle [rad] of the pivot at rest: its weight's moment is a sine of it."""
        moments = []
        self.data.qvel[:] = 0.0
        for angle in (0.0, 0.5 * math.pi):
            self.data.qpos[self.size + 1] = angle
            mujoco.mj_forward(self.model, self.data)
            moments.append(self.data.qfrc_bias[self.size])
        return math.atan2(-moments[0], moments[1])

    def mass(self, chi: np.ndarray, swing: float = math.nan) -> np.ndarray:
        """Return M of base, arm and pivot, (used, used), at rest at a pose; see `place`."""
        self.place(chi, swing)
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        used = self.size + self.pivot
        whole, column = np.empty((used, used)), np.empty(self.model.nv)
        for i, unit in enumerate(np.eye(self.model.nv)[:used]):
            mujoco.mj_mulM(self.model, self.data, column, unit)
            whole[:, i] = column[:used]
        return whole

    def evaluate(
        self,
        chi: np.ndarray,
        chi_dot: np.ndarray,
        swing: np.ndarray,
        mass: np.ndarray,
        coriolis: np.ndarray,
        gravity: np.ndarray,
        pivot: np.ndarray,
    ) -> None:
        """Write M (6 + n, 6 + n), C chi_dot, g and pivot force (6 + n,) of a state into the last 4.

        chi, chi_dot (6 + n,): SI units, position in the world, body rates in FLU. swing (3,): angle
        [rad], rate, acceleration of the pivot, see `place`. Units of the results: see `Dynamics`.
        """
        model, data, size = self.model, self.data, self.size
        whole = self.mass(chi, swing[0])
        mass[:], gravity[:] = whole[:size, :size], data.qfrc_bias[:size]
        data.qvel[:size] = chi_dot
        mujoco.mj_fwdVelocity(model, data)
        coriolis[:] = data.qfrc_bias[:size] - gravity
        if not self.pivot:
            pivot[:] = 0.0
            return
        pivot[:] = whole[:size, size] * swing[2] - data.qfrc_bias[:size]
        data.qvel[size] = swing[1]
        mujoco.mj_fwdVelocity(model, data)
        pivot += data.qfrc_bias[:size]


def along(series: Series, rows: np.ndarray, vehicle: Vehicle, payload_mass: float) -> Dynamics:
    """Return the true dynamics at `rows` (m,) of a flight; payload_mass in kg."""
    count, size = len(rows), series.columns.size
    truth = series.block("truth.").reshape(-1, 3, size)[rows]
    swing = pivot_motion(series)[rows]
    held = tracking.carrying(series)[rows] if payload_mass else np.zeros(count, dtype=bool)
    bare = Body(vehicle)
    loaded = bare
    if held.any():
        loaded = Body(vehicle, payload_mass, hold(series, rows[held], bare))
    found = Dynamics(
        np.empty((count, size, size)), *(np.empty((count, size)) for _ in range(3)), held
    )
    for k in range(count):
        (loaded if held[k] else bare).evaluate(
            truth[k, CHI], truth[k, CHI_DOT], swing[k],
            found.mass[k], found.coriolis[k], found.gravity[k], found.pivot[k],
        )  # fmt: skip
    return found


def pivot_motion(series: Series) -> np.ndarray:
    """Return angle [rad], rate and acceleration (ticks, 3) of the pivot, by differences."""
    angle = np.nan_to_num(series["magnet.swing"])
    rate = np.gradient(angle, tracking.period(series))
    return np.column_stack([angle, rate, np.gradient(rate, tracking.period(series))])


def hold(series: Series, rows: np.ndarray, body: Body) -> np.ndarray:
    """Return the payload's centre in the magnet's frame (3,) [m]: median over some of `rows`."""
    truth, swing = series.block("truth."), series["magnet.swing"]
    place = series.block("payload.")[:, :3]
    magnet = body.data.body("magnet")
    found = []
    for row in rows[:: max(1, len(rows) // 20)]:
        body.place(truth[row, : series.columns.size], swing[row])
        mujoco.mj_kinematics(body.model, body.data)
        found.append(magnet.xmat.reshape(3, 3).T @ (place[row] - magnet.xpos))
    return np.median(found, axis=0)
