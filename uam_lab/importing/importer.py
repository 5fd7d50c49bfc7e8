"""From a description to the folder of a vehicle: MJCF, YAML, picture, and what was assumed."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from uam_control.settings.atomic import write_text
from uam_control.vehicle import DEFAULT_VEHICLE, VehicleDescription, load_description
from uam_lab.importing import geometry, mjcf_file, numbers, urdf_file
from uam_lab.importing.answers import ASSUMED, DERIVED, Answers, Told
from uam_lab.importing.mjcf_text import MjcfText
from uam_lab.importing.source import ImportRefused, Source, kind_of, tree
from uam_lab.importing.standing import Stance, stand
from uam_lab.importing.structure import BASE, Chosen, Parts, find
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.arm_geometry import outline

SMALL = ("sensors", "variation", "air")  # whose assumptions stand in the YAML file alone
READERS = {"robot": urdf_file.read, "mujoco": mjcf_file.read}
BELOW = 0.06  # [m] from the centre of mass: where the underside of the base is looked for
PLAIN = re.compile(r"(?!(?i:y|n|yes|no|on|off|true|false|null)$)[A-Za-z_][\w./-]*")  # text in YAML
PREFIX = "hung/"
OPTIONS = tuple(k for k in vars(mujoco.MjOption) if not k.startswith("_"))
TOP = 0.008  # [m] of the bracket below the origin, of parts/arm_2r.xml and arm_3r.xml


@dataclass(frozen=True)
class Imported:
    """A vehicle that was written: its YAML file, and lines about it for the user."""

    description: VehicleDescription
    found: tuple[str, ...]
    missing: tuple[str, ...]


def import_vehicle(
    file: Path,
    folder: Path,
    name: str,
    chosen: Chosen,
    answers: Answers,
    arm_of: VehicleDescription | None = None,
) -> Imported:
    """Write the vehicle `name` of a URDF or MJCF to `folder`.

    arm_of: vehicle whose arm hangs below a base without one. Raises ImportRefused; nothing is
    written then, unless the vehicle that was written contradicts itself.
    """
    root = tree(file)
    source = READERS[kind_of(file, root)](file, root)
    mount = None if arm_of is None else hang(source, chosen, arm_of)
    parts = find(source, chosen)
    if not parts.joints:
        raise ImportRefused(
            f"{file}: no arm: no revolute joint hangs on '{parts.model.body(parts.base).name}'; "
            f"--arm-of {DEFAULT_VEHICLE} hangs that vehicle's below it"
        )
    geometry.refuse_units(parts)
    stance = stand(parts, answers, None if arm_of is None else arm_of.stowed)
    if arm_of is None:
        servos = numbers.servos_for(parts, answers, numbers.masses(parts))
    else:
        servos = numbers.servos_of(arm_of)
    tree_of_numbers = numbers.document(parts, stance, answers, name, servos)
    model = MjcfText(parts, stance, folder, servos.stall).write(name)
    tree_of_numbers["mass"].value = _mass(model)
    written = folder / f"{name}.yaml"
    head = f"# {name}: imported from {file.name} by uam vehicle import. SI units, frames FLU.\n"
    head += "# Behind each number: where it comes from.\n"
    write_text(written, head + "".join(lines(tree_of_numbers)))
    description = load_description(written)
    Vehicle.of(description).compile(0.0)
    found = tuple(_found(parts, stance, mount))
    parts.notes += [f"answer {key}: of no use for this vehicle" for key in sorted(answers.unused)]
    missing = (*parts.source.notes, *parts.notes, *_assumed(tree_of_numbers))
    if stance.legs.value:
        missing += (f"landing gear: {stance.legs}",)
    text = "\n".join(("found:", *found, "", "missing or assumed:", *missing, ""))
    write_text(folder / f"{name}.txt", text)
    return Imported(description, found, missing)


def _mass(model: Path) -> float:
    """Return the mass [kg] of the vehicle that was written; raise ImportRefused if it is none."""
    try:
        compiled = mujoco.MjModel.from_xml_path(str(model))
    except ValueError as error:
        raise ImportRefused(f"{model}: {' '.join(str(error).split())}") from None
    return round(float(compiled.body_subtreemass[compiled.body("base").id]), 5)


def lines(values: dict[str, Any], indent: str = "") -> Iterator[str]:
    """Yield the lines of a YAML file, with the origin of each value behind it."""
    for key, value in values.items():
        if isinstance(value, Told):
            yield f"{indent}{key}: {_text(value.value)}  # {value}\n"
        elif isinstance(value, dict):
            yield f"{indent}{key}:\n"
            yield from lines(value, f"{indent}  ")
        else:
            yield f"{indent}{key}:\n"
            for entry in value:
                inner = ", ".join(f"{k}: {_text(_plain(v))}" for k, v in entry.items())
                told = "; ".join(f"{k} {v}" for k, v in entry.items() if isinstance(v, Told))
                yield f"{indent}  - {{{inner}}}  # {told}\n"


def _plain(value: Any) -> Any:
    return value.value if isinstance(value, Told) else value


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, str) and not PLAIN.fullmatch(value):
        return json.dumps(value, ensure_ascii=False)
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _found(parts: Parts, stance: Stance, mount: Told | None) -> Iterator[str]:
    """Yield what the import found, in lines."""
    model = parts.model
    yield f"base: {model.body(parts.base).name}, {geometry.inertial(parts, 0)[0]:.4g} kg"
    names = ", ".join(model.joint(joint).name for joint in parts.joints)
    yield f"arm: {len(parts.joints)} joints: {names}"
    if mount is not None:
        yield f"arm of another vehicle: at {mount.value} m ({mount})"
    hangs = "; a magnet hangs there" if parts.magnet else ""
    yield f"end effector: {parts.tip or 'far end of the last link'}{hangs}"
    names = ", ".join(dict.fromkeys(one.name for one in parts.rotors))
    yield f"rotors: {len(parts.rotors)}: {names}"
    yield f"feet: {stance.legs}"
    stowed = ", ".join(f"{one.value:g}" for one in stance.stowed)
    yield f"stowed: {stowed} deg"


def _assumed(values: dict[str, Any], above: str = "") -> Iterator[str]:
    """Yield the entries that were assumed, those of a section for one reason together."""
    together: dict[str, list[str]] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            if key not in SMALL:
                yield from _assumed(value, f"{key}.")
            continue
        if isinstance(value, Told):
            if value.origin == ASSUMED:
                together.setdefault(str(value), []).append(f"{key}: {_text(value.value)}")
            continue
        for why, names in _assumed_of(value).items():
            every = len(names) == len(value)
            together.setdefault(why, []).append(key if every else f"{key} {', '.join(names)}")
    for why, entries in together.items():
        yield f"{above}{', '.join(entries)} ({why})"


def _assumed_of(entries: list[dict[str, Any]]) -> dict[str, list[str]]:
    """Return why → names of the entries of a list of which something was assumed."""
    found: dict[str, list[str]] = {}
    for one in entries:
        told = (v for v in one.values() if isinstance(v, Told) and v.origin == ASSUMED)
        for why in dict.fromkeys(map(str, told)):
            found.setdefault(why, []).append(str(one["name"]))
    return found


def usual_name(file: Path) -> str:
    """Return the name of a vehicle by its file."""
    return "".join(c if c.isalnum() else "_" for c in file.stem.lower()).strip("_") or "vehicle"


def hang(source: Source, chosen: Chosen, vehicle: VehicleDescription) -> Told:
    """Hang the arm of `vehicle` below the base of `source`; return where [m], and why there.

    Raises ImportRefused for a description that has an arm.
    """
    parts = find(source, chosen)
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
        for body in list(other.body(BASE).bodies):
            frame.attach_body(body, PREFIX, "")
        for part in (*source.spec.bodies, *source.spec.joints, *source.spec.sites):
            part.name = part.name.removeprefix(PREFIX)
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ImportRefused(f"{vehicle.model}: its arm cannot be hung: {reason}") from None
    return Told([round(float(x), 4) for x in place], DERIVED, f"arm of {vehicle.name}")


def _underside(parts: Parts) -> np.ndarray:
    """Return the place (3,) [m] below the middle of the base, in its frame."""
    origin, axes = parts.frame(0)
    centre = geometry.inertial(parts, 0)[1]
    geoms = geometry.shapes(parts, 0, True) + geometry.shapes(parts, 0, False)
    if not geoms:
        return centre
    points = [(outline(parts.model, parts.data, g) - origin) @ axes for g in geoms]
    near = [p[np.linalg.norm(p[:, :2] - centre[:2], axis=1) < BELOW] for p in points]
    low = min((float(p[:, 2].min()) for p in near if len(p)), default=float(centre[2]))
    return np.array([centre[0], centre[1], low + TOP])
