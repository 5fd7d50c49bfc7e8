"""The MJCF of a vehicle, with the bodies of its gripper."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uam_control.vehicle.description import VehicleDescription

if TYPE_CHECKING:
    import mujoco

PREFIX = "gripper_"  # of the names of a gripper's parts


def model_spec(vehicle: VehicleDescription) -> mujoco.MjSpec:
    """Return the MJCF of a vehicle with its gripper. Raises ValueError."""
    import mujoco  # takes 0.3 s and chooses its renderer: only where a model is read

    spec, g = mujoco.MjSpec.from_file(str(vehicle.model)), vehicle.numbers.get("gripper")
    if g is None:
        return spec
    for name in filter(None, (g["body"], g.get("instead_of"))):
        if spec.body(name) is None:
            raise ValueError(f"no body '{name}' for the gripper of {vehicle.file.name}")
    if g.get("instead_of"):
        spec.delete(spec.body(g["instead_of"]))
    part = mujoco.MjSpec.from_file(g["model"])
    part.geom("body").mass = g["mass"]
    for name in ("left", "right"):
        part.geom(name).friction[0] = g["friction"]
    spec.attach(part, frame=spec.body(g["body"]).add_frame(pos=g["position"]), prefix=PREFIX)
    return spec
