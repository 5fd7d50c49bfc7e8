"""URDF of the vehicle, generated from the compiled MJCF, the source of masses, axes and shapes."""

from xml.etree import ElementTree

import mujoco
import numpy as np

from uam_control.maths.rotations import euler_from_quaternion
from uam_control.vehicle import Servo
from uam_sim_bridge.plant.frames import BASE_LINK, Frame, carried, frames
from uam_sim_bridge.plant.vehicle import BASE, Vehicle

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
    model, described = vehicle.compile(0.0), vehicle.description
    robot = ElementTree.Element("robot", name=model.body(BASE).name)
    servos = dict(zip(described.joint_names, described.servos, strict=True))
    _link(robot, model, model.body(BASE).id, BASE_LINK)
    for body, frame in zip(carried(model), frames(model), strict=True):
        _link(robot, model, body, frame.name)
        _joint(robot, model, frame, servos.get(frame.joint, PASSIVE))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _link(robot: ElementTree.Element, model: mujoco.MjModel, body: int, name: str) -> None:
    link = ElementTree.SubElement(robot, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_text(model.body_ipos[body]), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=_text(model.body_mass[body : body + 1]))
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, model.body_iquat[body])
    axes = axes.reshape(3, 3)
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
    for geom in np.flatnonzero(model.geom_bodyid == body):
        _visual(link, model, geom)


def _visual(link: ElementTree.Element, model: mujoco.MjModel, geom: int) -> None:
    shape = SHAPES.get(mujoco.mjtGeom(model.geom_type[geom]))
    if shape is None:
        return
    visual = ElementTree.SubElement(link, "visual")
    _origin(visual, model.geom_pos[geom], model.geom_quat[geom])
    tag, attributes = shape(model.geom_size[geom])
    ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), tag, attributes)
    material = model.geom_matid[geom]
    colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    paint = ElementTree.SubElement(visual, "material", name=f"colour_{geom}")
    ElementTree.SubElement(paint, "color", rgba=_text(colour))


def _joint(robot: ElementTree.Element, model: mujoco.MjModel, frame: Frame, servo: Servo) -> None:
    hinge = model.joint(frame.joint) if frame.joint else None
    limited = hinge is not None and bool(hinge.limited[0])
    kind = "fixed" if hinge is None else "revolute" if limited else "continuous"
    kind = "prismatic" if frame.slides else kind
    name = frame.joint or f"{frame.name}_mount"
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    _origin(joint, frame.position, frame.quaternion)
    ElementTree.SubElement(joint, "parent", link=frame.parent)
    ElementTree.SubElement(joint, "child", link=frame.name)
    if hinge is not None:
        ElementTree.SubElement(joint, "axis", xyz=_text(frame.axis))
    if limited:
        numbers = {
            "lower": hinge.range[0],
            "upper": hinge.range[1],
            "effort": servo.stall_torque,
            "velocity": servo.no_load_speed,
        }
        ElementTree.SubElement(joint, "limit", {key: _text([n]) for key, n in numbers.items()})


def _origin(of: ElementTree.Element, position: np.ndarray, quaternion: np.ndarray) -> None:
    turn = euler_from_quaternion(quaternion)  # URDF's rpy: about fixed axes
    ElementTree.SubElement(of, "origin", xyz=_text(position), rpy=_text(turn))


def _text(numbers: np.ndarray | list) -> str:
    return " ".join(f"{float(n):.9g}" for n in numbers)
