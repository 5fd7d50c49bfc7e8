"""Masses, shapes and places of the links, from the model of the file."""

import math

import mujoco
import numpy as np

from uam_lab.importing.source import LARGE, ImportRefused
from uam_lab.importing.structure import Parts
from uam_sim_bridge.plant.arm_geometry import outline

LEAST_MASS = 1e-6  # [kg]
LEAST_INERTIA = 1e-9  # [kg m^2]
FARTHEST, HEAVIEST = 5.0, 100.0  # [m] of a rotor, radius of gyration; [kg] of a link
HINGE_DEG = 140.0  # of the magnet's hinge from the last link: 10 less than in parts/magnet.xml
ALONG = 1e-6  # of an axis that counts as upright or forward
SHORT = 0.01  # [m] tip from the last joint
SHAPES = mujoco.mjtGeom


def inertial(parts: Parts, link: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass [kg], centre (3,) [m] and inertia (3, 3) [kg m^2] about it, in the link's frame.

    Raises ImportRefused for a link that has none, by name and line.
    """
    model, data = parts.model, parts.data
    origin, axes = parts.frame(link)
    bodies = parts.bodies(link)
    masses = model.body_mass[bodies]
    total = float(masses.sum())
    name = model.body(parts.base if link == 0 else _body_of(parts, link)).name
    if total < LEAST_MASS:
        raise parts.source.error("body", name, "no mass: <inertial> or shapes with a density")
    centre = (masses @ data.xipos[bodies]) / total
    tensor = np.zeros((3, 3))
    for body, mass in zip(bodies, masses, strict=True):
        turn = data.ximat[body].reshape(3, 3)
        off = data.xipos[body] - centre
        tensor += turn @ np.diag(model.body_inertia[body]) @ turn.T
        tensor += mass * ((off @ off) * np.eye(3) - np.outer(off, off))
    if (least := np.linalg.eigvalsh(tensor)[0]) < LEAST_INERTIA:
        raise parts.source.error("body", name, f"inertia {least:.2g} kg m^2 is nothing")
    return total, axes.T @ (centre - origin), axes.T @ tensor @ axes


def _body_of(parts: Parts, link: int) -> int:
    return int(parts.model.jnt_bodyid[parts.joints[link - 1]])


def shapes(parts: Parts, link: int, colliding: bool) -> list[int]:
    """Return the geoms of a link that collide, or that are only shown."""
    model = parts.model
    touch = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    own = np.isin(model.geom_bodyid, parts.bodies(link))
    flat = np.isin(model.geom_type, (SHAPES.mjGEOM_PLANE, SHAPES.mjGEOM_HFIELD))
    return np.flatnonzero(own & ~flat & (touch == colliding)).tolist()


def tip(parts: Parts) -> tuple[np.ndarray, np.ndarray]:
    """Return place (3,) [m] and axes (3, 3) of the magnet's pivot in the frame of the last link.

    z points back along the link, y along the axis about which the face shall level itself, to the
    left of the base where it has a left side: the tool heads where the base does.
    """
    link = len(parts.joints)
    origin, axes = parts.frame(link)
    place = axes.T @ (_named(parts) - origin) if parts.tip else np.zeros(3)
    if np.linalg.norm(place) < SHORT:
        place = _far_end(parts)
    along = place / np.linalg.norm(place)
    turns = [axes.T @ parts.data.xaxis[joint] for joint in reversed(parts.joints)]
    for axis in (*turns, *np.eye(3)):
        across = axis - (axis @ along) * along
        if np.linalg.norm(across) > 0.5:
            break
    left = float(across @ axes.T @ parts.frame(0)[1][:, 1])
    y = across / (np.linalg.norm(across) if left > ALONG else -np.linalg.norm(across))
    return place, np.column_stack([np.cross(y, -along), y, -along])


def hangs(parts: Parts) -> bool:
    """Return whether the magnet hangs straight down within the range of its hinge, of a level base;
    True without one."""
    if not parts.magnet:
        return True
    back = parts.frame(len(parts.joints))[1] @ tip(parts)[1][:, 2]
    return float(back @ parts.frame(0)[1][:, 2]) > math.cos(math.radians(HINGE_DEG))


def _named(parts: Parts) -> np.ndarray:
    model, data = parts.model, parts.data
    for site in range(model.nsite):
        if model.site(site).name == parts.tip:
            return data.site_xpos[site]
    return data.xpos[model.body(parts.tip).id]


def _far_end(parts: Parts) -> np.ndarray:
    """Return the far end (3,) [m] of the last link, along its centre of mass."""
    link = len(parts.joints)
    origin, axes = parts.frame(link)
    centre = inertial(parts, link)[1]
    if np.linalg.norm(centre) < 1e-3:
        name = parts.model.joint(parts.joints[-1]).name
        text = f"its link has no far end: an end effector {1e3 * SHORT:g} mm from it is needed"
        raise parts.source.error("joint", name, text)
    along = centre / np.linalg.norm(centre)
    geoms = shapes(parts, link, True) + shapes(parts, link, False)
    reach = [
        float(((outline(parts.model, parts.data, g) - origin) @ axes @ along).max()) for g in geoms
    ]
    return max([*reach, 2.0 * float(np.linalg.norm(centre))]) * along


def set_angles(parts: Parts, angles: np.ndarray) -> None:
    """Set the joints to angles (n,) [rad] of the file."""
    for joint, angle in zip(parts.joints, angles, strict=True):
        parts.data.qpos[parts.model.jnt_qposadr[joint]] = angle
    mujoco.mj_kinematics(parts.model, parts.data)
    mujoco.mj_comPos(parts.model, parts.data)


def holding_torques(parts: Parts, load: float, gravity: float) -> np.ndarray:
    """Return the largest torque (n,) [N m] that holds each joint of a level base, load [kg] at the
    tip: the far links outstretched at right angles to gravity."""
    origin, axes = parts.frame(len(parts.joints))
    anchors = [parts.data.xanchor[j] for j in parts.joints]
    ends = np.array([*anchors, origin + axes @ tip(parts)[0]])
    lengths = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    found = []
    for i in range(len(parts.joints)):
        moment, before = 0.0, 0.0
        for k in range(i, len(parts.joints)):
            mass, centre, _ = inertial(parts, k + 1)
            moment += mass * (before + float(np.linalg.norm(centre)))
            before += lengths[k]
        found.append(gravity * (moment + load * before))
    return np.array(found)


def pose_of(parts: Parts, geom: int) -> tuple[np.ndarray, np.ndarray]:
    """Return place (3,) [m] and axes (3, 3) of a shape in the file's world, as a file states them:
    MuJoCo moves a mesh to its centre of mass."""
    model, data = parts.model, parts.data
    place, axes = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    mesh = model.geom_dataid[geom]
    if model.geom_type[geom] != SHAPES.mjGEOM_MESH or mesh < 0:
        return place, axes
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[mesh])
    axes = axes @ turn.reshape(3, 3).T
    return place - axes @ model.mesh_pos[mesh], axes


def refuse_units(parts: Parts) -> None:
    """Raise ImportRefused for what can only be in another unit: mm, g, g mm^2."""
    for rotor in parts.rotors:
        if (far := float(np.linalg.norm(rotor.position))) > FARTHEST:
            raise ImportRefused(f"{rotor.where}: rotor '{rotor.name}' is {far:g} m away: in mm?")
    for link in range(len(parts.joints) + 1):
        mass, _, tensor = inertial(parts, link)
        body = parts.model.body(parts.base if link == 0 else _body_of(parts, link)).name
        if mass > HEAVIEST:
            raise parts.source.error("body", body, f"{mass:g} kg: in g? kg are expected")
        if (most := float(np.linalg.eigvalsh(tensor)[-1])) > mass * FARTHEST**2:
            text = f"inertia {most:.3g} kg m^2 of {mass:.3g} kg: in g mm^2? kg m^2 are expected"
            raise parts.source.error("body", body, text)
        for geom in shapes(parts, link, True) + shapes(parts, link, False):
            if (large := 2.0 * float(parts.model.geom_rbound[geom])) > LARGE:
                text = f"its shape is {large:.4g} m large: in mm? m are expected"
                raise parts.source.error("body", body, text)
