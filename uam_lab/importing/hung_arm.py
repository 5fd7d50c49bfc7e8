"""The arm of another vehicle below a base that has none."""

from __future__ import annotations

import mujoco
import numpy as np

from uam_control.vehicle import VehicleDescription
from uam_lab.importing import geometry, structure
from uam_lab.importing.answers import DERIVED, Told
from uam_lab.importing.source import ImportRefused, Source

BELOW = 0.06  # [m] from the centre of mass: where the underside of the base is looked for
PREFIX = "hung/"
OPTIONS = tuple(k for k in vars(mujoco.MjOption) if not k.startswith("_"))
TOP = 0.008  # [m] of the bracket below the origin, of parts/arm_2r.xml and arm_3r.xml


def hang(source: Source, chosen: structure.Chosen, vehicle: VehicleDescription) -> Told:
    """Hang the arm of `vehicle` below the base of `source`; return where [m], and why there.

    Raises ImportRefused for a description that has an arm.
    """
    parts = structure.find(source, chosen)
    if parts.joints:
        name = parts.model.joint(parts.joints[0]).name
        raise source.error("joint", name, "the vehicle has an arm; --arm-of is for one without")
    place = _underside(parts)
    base = source.spec.body(parts.model.body(parts.base).name)
    try:
        other = mujoco.MjSpec.from_file(str(vehicle.model))
        for key in OPTIONS:  # MuJoCo warns where they differ
            setattr(other.option, key, getattr(source.spec.option, key))
        other.memory = source.spec.memory
        scale = 180.0 / np.pi if other.compiler.degree else 1.0
        for joint in vehicle.joints:
            element = other.joint(joint.name)
            element.range = scale * np.array([joint.low, joint.high])
            element.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        frame = base.add_frame(pos=place)
        for body in list(other.body(structure.BASE).bodies):
            frame.attach_body(body, PREFIX, "")
        for part in (*source.spec.bodies, *source.spec.joints, *source.spec.sites):
            part.name = part.name.removeprefix(PREFIX)
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ImportRefused(f"{vehicle.model}: its arm cannot be hung: {reason}") from None
    return Told([round(float(x), 4) for x in place], DERIVED, f"arm of {vehicle.name}")


def _underside(parts: structure.Parts) -> np.ndarray:
    """Return the place (3,) [m] below the middle of the base, in its frame."""
    origin, axes = parts.frame(0)
    centre = geometry.inertial(parts, 0)[1]
    geoms = geometry.shapes(parts, 0, True) + geometry.shapes(parts, 0, False)
    if not geoms:
        return centre
    points = [(geometry.outline(parts, g) - origin) @ axes for g in geoms]
    near = [p[np.linalg.norm(p[:, :2] - centre[:2], axis=1) < BELOW] for p in points]
    low = min((float(p[:, 2].min()) for p in near if len(p)), default=float(centre[2]))
    return np.array([centre[0], centre[1], low + TOP])
