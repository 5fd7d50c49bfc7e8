"""Where the arm of the plant's model is: its lowest point on the ground. Outlines of shapes.

Read from the compiled model, so that any form of MJCF counts.
"""

import itertools
import math
from collections.abc import Sequence

import mujoco
import numpy as np

BASE, FACE = "base", "magnet_face"  # body and site of the MJCF
MAGNET, END_EFFECTOR = "magnet", "end_effector"  # body of a magnet, site of an arm without one
SWING = "magnet_swing"  # the joint of the magnet's pivot, without a sensor
NO_LENGTH = 1e-9  # [m]
SHAPES = mujoco.mjtGeom
DIRECTIONS = np.array([d for d in itertools.product((-1, 0, 1), repeat=3) if any(d)], dtype=float)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]


def room_below(
    model: mujoco.MjModel, joints: Sequence[str], angles: Sequence[float]
) -> float | None:
    """Return how far the arm's lowest point is above that of the gear [m]; None without a gear.

    angles (n,) [rad]; the base is level, the magnet hangs.
    """
    data = _posed(model, joints, angles)
    _hang(model, data)
    base, first = model.body(BASE).id, model.joint(joints[0]).bodyid[0]
    ends = [name for name in (FACE, END_EFFECTOR) if has(model, mujoco.mjtObj.mjOBJ_SITE, name)]
    gear, arm = [], [float(data.site(name).xpos[2]) for name in ends]
    for geom in np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0)):
        body = model.geom_bodyid[geom]
        if not _meets_the_world(model, geom):
            continue
        if model.body_weldid[body] == model.body_weldid[base]:
            gear.append(_lowest(model, data, geom))
        elif first in carriers(model, body):
            arm.append(_lowest(model, data, geom))
    return min(arm) - min(gear) if gear and arm else None


def tip_of(model: mujoco.MjModel, data: mujoco.MjData, last: int) -> np.ndarray:
    """Return the place (3,) [m, ENU] of the arm's tip, a view: the magnet's pivot, or the end
    effector, or without both the body `last`."""
    if has(model, mujoco.mjtObj.mjOBJ_SITE, END_EFFECTOR):
        return data.site_xpos[model.site(END_EFFECTOR).id]
    magnet = has(model, mujoco.mjtObj.mjOBJ_BODY, MAGNET)
    return data.xpos[model.body(MAGNET).id if magnet else last]


def carriers(model: mujoco.MjModel, body: int) -> list[int]:
    """Return a body and those that carry it, one after the other, without the world."""
    found = []
    while body:
        found.append(int(body))
        body = model.body_parentid[body]
    return found


def has(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> bool:
    return mujoco.mj_name2id(model, kind, name) >= 0


def outline(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, exact: bool = True
) -> np.ndarray:
    """Return points (m, 3) [m] on the outside of a shape, in the world.

    exact: with the vertices of a mesh, else with its box.
    """
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == SHAPES.mjGEOM_SPHERE:
        local = size[0] * DIRECTIONS
    elif kind in (SHAPES.mjGEOM_CAPSULE, SHAPES.mjGEOM_CYLINDER):
        ends = np.array([[0, 0, size[1]], [0, 0, -size[1]]])
        round_ = DIRECTIONS if kind == SHAPES.mjGEOM_CAPSULE else DIRECTIONS * (1, 1, 0)
        norm = np.maximum(np.linalg.norm(round_, axis=1), 1e-9)[:, None]
        local = (ends[:, None] + size[0] * (round_ / norm)[None]).reshape(-1, 3)
    elif kind == SHAPES.mjGEOM_ELLIPSOID:
        local = size * DIRECTIONS
    elif kind == SHAPES.mjGEOM_MESH and exact:
        local = _vertices(model, geom)
    else:
        box = model.geom_aabb[geom]
        local = box[:3] + box[3:] * np.array(list(itertools.product((-1, 1), repeat=3)))
    return data.geom_xpos[geom] + local @ data.geom_xmat[geom].reshape(3, 3).T


def _vertices(model: mujoco.MjModel, geom: int) -> np.ndarray:
    mesh = model.mesh(model.geom_dataid[geom])
    return model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]


def _posed(model: mujoco.MjModel, joints: Sequence[str], angles: Sequence[float]) -> mujoco.MjData:
    """Return the data of a level base at the origin, with joint angles (n,) [rad]."""
    data = mujoco.MjData(model)
    base = model.joint(BASE).qposadr[0]
    data.qpos[base : base + 7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    if has(model, mujoco.mjtObj.mjOBJ_JOINT, SWING):
        data.joint(SWING).qpos = 0.0
    for name, angle in zip(joints, angles, strict=True):
        data.joint(name).qpos = angle
    mujoco.mj_kinematics(model, data)
    return data


def _hang(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Turn the magnet's pivot, if there is one, so that its face is as low as possible."""
    if not has(model, mujoco.mjtObj.mjOBJ_JOINT, SWING):
        return
    pivot = data.joint(SWING)
    way, axis = data.site(FACE).xpos - pivot.xanchor, pivot.xaxis
    along, across = way[2] - (way @ axis) * axis[2], np.cross(axis, way)[2]
    if math.hypot(along, across) < NO_LENGTH:
        return
    angle = math.remainder(math.atan2(across, along) + math.pi, math.tau)
    joint = model.joint(SWING)
    pivot.qpos = np.clip(angle, *joint.range) if joint.limited[0] else angle
    mujoco.mj_kinematics(model, data)


def _meets_the_world(model: mujoco.MjModel, geom: int) -> bool:
    world = model.geom_bodyid == 0
    bits = model.geom_contype[world] & model.geom_conaffinity[geom]
    return bool(np.any(bits | (model.geom_conaffinity[world] & model.geom_contype[geom])))


def _lowest(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Return the height [m] of a shape's lowest point; of its box, where the shape is unusual."""
    up = data.geom_xmat[geom].reshape(3, 3)[2]
    centre, size, kind = data.geom_xpos[geom][2], model.geom_size[geom], model.geom_type[geom]
    if kind == SHAPES.mjGEOM_SPHERE:
        return float(centre - size[0])
    if kind == SHAPES.mjGEOM_CAPSULE:
        return float(centre - abs(up[2]) * size[1] - size[0])
    if kind == SHAPES.mjGEOM_CYLINDER:
        return float(centre - abs(up[2]) * size[1] - math.hypot(up[0], up[1]) * size[0])
    if kind == SHAPES.mjGEOM_ELLIPSOID:
        return float(centre - np.linalg.norm(up * size))
    if kind == SHAPES.mjGEOM_MESH:
        return float(centre + (_vertices(model, geom) @ up).min())
    box = model.geom_aabb[geom]
    return float(centre + up @ box[:3] - np.abs(up) @ box[3:])
