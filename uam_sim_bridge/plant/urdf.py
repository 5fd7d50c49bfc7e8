"""URDF of the vehicle, generated from the compiled MJCF, the source of masses, axes and shapes."""

from xml.etree import ElementTree

import mujoco
import numpy as np

from uam_control.vehicle import Servo
from uam_sim_bridge.plant.vehicle import BASE, Vehicle

BASE_LINK = "base_link"  # REP-105's name of the base
PASSIVE = Servo(0.0, 0.0, 0.0)  # of a hinge without one
SHAPES = {
    mujoco.mjtGeom.mjGEOM_BOX: lambda s: ("box", {"size": _text(2.0 * s)}),
    mujoco.mjtGeom.mjGEOM_SPHERE: lambda s: ("sphere", {"radius": _text(s[:1])}),
    mujoco.mjtGeom.mjGEOM_CYLINDER: lambda s: (
        "cylinder",
        {"radius": _text(s[:1]), "length": _text(2.0 * s[1:2])},
    ),
    # URDF has no capsule: a cylinder of the capsule's whole length
    mujoco.mjtGeom.mjGEOM_CAPSULE: lambda s: (
        "cylinder",
        {"radius": _text(s[:1]), "length": _text(2.0 * (s[1:2] + s[:1]))},
    ),
}


def urdf(vehicle: Vehicle) -> str:
    """Return the URDF text: base and arm, inertia and visuals; frames as in the MJCF (FLU)."""
    model = vehicle.compile(0.0)
    robot = ElementTree.Element("robot", name=model.body(BASE).name)
    root, described = model.body(BASE).id, vehicle.description
    servos = dict(zip(described.joint_names, described.servos, strict=True))
    for body in (root, *carried(model)):
        name = BASE_LINK if body == root else model.body(body).name
        link = ElementTree.SubElement(robot, "link", name=name)
        _inertial(link, model, body)
        for geom in np.flatnonzero(model.geom_bodyid == body):
            _visual(link, model, geom)
        if body != root:
            parent = model.body_parentid[body]
            owner = BASE_LINK if parent == root else model.body(parent).name
            _joint(robot, model, body, owner, servos)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def carried(model: mujoco.MjModel) -> list[int]:
    """Return the bodies carried by the vehicle's base, parents first, without massless ones."""
    root = model.body(BASE).id
    return [
        body
        for body in range(root + 1, model.nbody)
        if model.body_rootid[body] == root and model.body_mass[body] > 0.0
    ]


def _inertial(link: ElementTree.Element, model: mujoco.MjModel, body: int) -> None:
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_text(model.body_ipos[body]), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=_text(model.body_mass[body : body + 1]))
    axes = _matrix(model.body_iquat[body])
    tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
    ElementTree.SubElement(
        inertial,
        "inertia",
        {
            f"i{a}{b}": _text(tensor[i, j : j + 1])
            for i, a in enumerate("xyz")
            for j, b in enumerate("xyz")
            if j >= i
        },
    )


def _visual(link: ElementTree.Element, model: mujoco.MjModel, geom: int) -> None:
    shape = SHAPES.get(mujoco.mjtGeom(model.geom_type[geom]))
    if shape is None:
        return
    visual = ElementTree.SubElement(link, "visual")
    ElementTree.SubElement(
        visual,
        "origin",
        xyz=_text(model.geom_pos[geom]),
        rpy=_text(_euler(_matrix(model.geom_quat[geom]))),
    )
    tag, attributes = shape(model.geom_size[geom])
    ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), tag, attributes)
    material = model.geom_matid[geom]
    colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    paint = ElementTree.SubElement(visual, "material", name=f"colour_{geom}")
    ElementTree.SubElement(paint, "color", rgba=_text(colour))


def _joint(
    robot: ElementTree.Element,
    model: mujoco.MjModel,
    body: int,
    parent: str,
    servos: dict[str, Servo],
) -> None:
    hinge = model.body_jntnum[body] > 0
    index = model.body_jntadr[body]
    slides = hinge and model.jnt_type[index] == mujoco.mjtJoint.mjJNT_SLIDE
    name = model.joint(index).name if hinge else f"{model.body(body).name}_mount"
    limited = hinge and bool(model.jnt_limited[index])
    kind = "fixed" if not hinge else "revolute" if limited else "continuous"
    kind = "prismatic" if slides else kind
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(
        joint,
        "origin",
        xyz=_text(model.body_pos[body]),
        rpy=_text(_euler(_matrix(model.body_quat[body]))),
    )
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=model.body(body).name)
    if hinge:
        ElementTree.SubElement(joint, "axis", xyz=_text(model.jnt_axis[index]))
    if limited:
        low, high = model.jnt_range[index]
        servo = servos.get(name, PASSIVE)
        ElementTree.SubElement(
            joint,
            "limit",
            lower=_text([low]),
            upper=_text([high]),
            effort=_text([servo.stall_torque]),
            velocity=_text([servo.no_load_speed]),
        )


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _euler(matrix: np.ndarray) -> np.ndarray:
    """Return fixed-axis roll, pitch, yaw (3,) [rad], URDF's rpy, of a rotation matrix (3, 3)."""
    return np.array(
        [
            np.arctan2(matrix[2, 1], matrix[2, 2]),
            np.arcsin(np.clip(-matrix[2, 0], -1.0, 1.0)),
            np.arctan2(matrix[1, 0], matrix[0, 0]),
        ]
    )


def _text(numbers: np.ndarray | list) -> str:
    return " ".join(f"{float(n):.9g}" for n in numbers)
