"""Frames of the vehicle's bodies (arm, magnet, fingers), from the same MJCF as the URDF."""

from dataclasses import dataclass

import mujoco
import numpy as np

from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
)
from uam_control.vehicle.chain_reader import hand_site
from uam_sim_bridge.plant.vehicle import BASE

BASE_LINK = "base_link"  # REP-105's name of the base


@dataclass(frozen=True)
class Frame:
    """Pose of a body in the frame of its parent."""

    name: str  # of its link in the URDF
    parent: str
    position: np.ndarray  # (3,) [m]
    quaternion: np.ndarray  # (4,) [w x y z] body → parent, with the joint at 0
    axis: np.ndarray  # (3,) unit vector of the hinge, or of a finger's slide
    joint: str = ""  # its name; "": a fixed body
    slides: bool = False

    def moved(self, joint: float) -> tuple[np.ndarray, np.ndarray]:
        """Return position (3,) [m] and quaternion (4,) [w x y z], body → parent, with its joint at
        an angle [rad], or at a way [m]."""
        if self.slides:
            way = matrix_from_quaternion(self.quaternion) @ self.axis
            return self.position + joint * way, self.quaternion
        turn = quaternion_from_rotation_vector(self.axis * joint)
        return self.position, quaternion_multiply(self.quaternion, turn)


@dataclass(frozen=True)
class Box:
    """A box in the frame of its body: centre (3,) and edges (3,) [m]."""

    centre: np.ndarray
    edges: np.ndarray


def carried(model: mujoco.MjModel) -> list[int]:
    """Return the bodies carried by the vehicle's base, parents first, without massless ones."""
    root = model.body(BASE).id
    return [
        body
        for body in range(root + 1, model.nbody)
        if model.body_rootid[body] == root and model.body_mass[body] > 0.0
    ]


def frames(model: mujoco.MjModel) -> list[Frame]:
    """Return the frames carried by the vehicle's base, parents first."""
    root = model.body(BASE).id
    return [_frame(model, body, root) for body in carried(model)]


def end_effector(model: mujoco.MjModel, site: str) -> list[Frame]:
    """Return the frame of the end effector, a site ("": see `hand_site`); [] without one."""
    number = hand_site(model, site)
    if number < 0:
        return []
    parent = model.body(model.site_bodyid[number]).name
    place, turn = model.site_pos[number].copy(), model.site_quat[number].copy()
    return [Frame("end_effector", parent, place, turn, np.zeros(3))]


def _frame(model: mujoco.MjModel, body: int, root: int) -> Frame:
    parent = model.body_parentid[body]
    index, kinds = model.body_jntadr[body], mujoco.mjtJoint
    kind = model.jnt_type[index] if index >= 0 else kinds.mjJNT_FREE
    slides = bool(kind == kinds.mjJNT_SLIDE)
    moves = slides or kind == kinds.mjJNT_HINGE
    return Frame(
        name=model.body(body).name,
        parent=BASE_LINK if parent == root else model.body(parent).name,
        position=model.body_pos[body].copy(),
        quaternion=model.body_quat[body].copy(),
        axis=model.jnt_axis[index].copy() if moves else np.zeros(3),
        joint=model.joint(index).name if moves else "",
        slides=slides,
    )


def box(model: mujoco.MjModel, name: str) -> Box:
    """Return the box of the geom `name`; the geom must be a box."""
    geom = model.geom(name)
    return Box(geom.pos.copy(), 2.0 * geom.size)


def hanging(pitch: float, alpha: np.ndarray) -> float:
    """Return the angle of the magnet's pivot [rad] at rest: its weight makes its face level.

    pitch [rad] of the vehicle; alpha (n,) [rad], positive in the opposite direction of pitch.
    """
    return float(pitch - alpha.sum())


def standing_height(model: mujoco.MjModel) -> float:
    """Return the height [m] of base_link above the floor on the landing gear.

    From the boxes around the colliding shapes of the base.
    """
    base, lowest = model.body(BASE).id, 0.0
    for i in range(model.ngeom):
        if model.geom_bodyid[i] != base or not (model.geom_contype[i] or model.geom_conaffinity[i]):
            continue
        turn = matrix_from_quaternion(model.geom_quat[i])
        centre, half = model.geom_aabb[i, :3], model.geom_aabb[i, 3:]
        below = model.geom_pos[i, 2] + turn[2] @ centre - np.abs(turn[2]) @ half
        lowest = min(lowest, float(below))
    return -lowest
