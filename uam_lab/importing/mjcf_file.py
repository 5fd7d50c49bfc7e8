"""MJCF: read by MuJoCo; lines of its parts, and what its actuators say of rotors and joints."""

import re
from pathlib import Path

import mujoco
import numpy as np
from lxml import etree

from uam_lab.importing.source import (
    ImportRefused,
    JointFacts,
    RotorFacts,
    Source,
    XmlElement,
    refused_by_mujoco,
    tree,
)

DEEPEST = 10  # of includes
ENDLESS = re.compile(r"(?i)(^|\s)[-+]?(nan|inf|infinity)(\s|$)")
TEXTS = ("name", "class", "childclass", "file", "model")  # attributes without numbers
KINDS = {"body": "body", "joint": "joint", "freejoint": "joint", "site": "site"}


def read(file: Path, root: XmlElement) -> Source:
    """Return the source of an MJCF with its includes. Raises ImportRefused."""
    lines: dict[tuple[str, str], str] = {}
    _note_lines(file, root, file.parent, lines)
    try:
        spec = mujoco.MjSpec.from_file(str(file))
    except ValueError as error:
        raise refused_by_mujoco(file, lines, error) from None
    source = Source(file, spec, lines)
    folder = file.parent / spec.meshdir
    for mesh in list(spec.meshes):
        if mesh.file:
            found = folder / mesh.file
            name = mesh.name or found.stem
            if not found.is_file():
                _leave_out(source, name, found)
            source.meshes[name] = found
    for joint in spec.joints:
        if np.any(np.asarray(joint.stiffness) > 0.0):
            where = source.where("joint", joint.name)
            source.notes.append(f"joint {joint.name}: its spring is left out ({where})")
    _actuators(source)
    _remove_the_rest(spec)
    return source


def _note_lines(file: Path, root: XmlElement, folder: Path, lines: dict, depth: int = 0) -> None:
    """Note file and line of each named part, includes too."""
    if depth > DEEPEST:
        raise ImportRefused(f"{file}: includes more than {DEEPEST} deep")
    for one in root.iter(etree.Element):
        where = f"{file} line {one.sourceline}"
        for key, value in one.attrib.items():
            if key not in TEXTS and ENDLESS.search(value):
                raise ImportRefused(
                    f"{where}: <{one.tag} {key}={value!r}>: finite numbers expected"
                )
        if one.tag == "include":
            inner = folder / (one.get("file") or "")
            if not inner.is_file():
                raise ImportRefused(f"{where}: {inner} does not exist")
            _note_lines(inner, tree(inner), folder, lines, depth + 1)
        elif one.tag == "mesh" and (one.get("name") or one.get("file")):
            lines["mesh", one.get("name") or Path(one.get("file")).stem] = where
        elif one.tag in KINDS and one.get("name"):
            lines[KINDS[one.tag], one.get("name")] = where


def _leave_out(source: Source, name: str, file: Path) -> None:
    """Remove the shapes of a missing mesh; refuse one that may have a mass."""
    where = source.where("mesh", name)
    for geom in list(source.spec.geoms):
        if geom.meshname == name:
            counts = geom.mass != 0.0 and not geom.parent.explicitinertial
            if counts and (geom.contype or geom.conaffinity):
                raise ImportRefused(f"{where}: mesh {file} is missing")
            source.spec.delete(geom)
    source.spec.delete(source.spec.mesh(name))
    source.notes.append(f"mesh {file} is missing: not shown ({where})")


def _actuators(source: Source) -> None:
    """Note the rotors that actuators at sites describe, and the limits of joint motors."""
    kinds = mujoco.mjtTrn
    for one in source.spec.actuators:
        gear, high = one.gear, float(one.ctrlrange[1])
        if one.trntype == kinds.mjTRN_SITE and gear[2] and not (gear[3] or gear[4]):
            facts = RotorFacts(thrust_max=abs(gear[2]) * high if high > 0.0 else None)
            if gear[5]:
                facts.counter_clockwise = bool(gear[5] / gear[2] < 0.0)
                facts.moment_ratio = abs(float(gear[5] / gear[2]))
            source.rotors[one.target] = facts
        elif one.trntype == kinds.mjTRN_JOINT:
            effort = float(one.forcerange[1]) if one.forcerange[1] > 0.0 else 0.0
            source.joints[one.target] = JointFacts(effort)


def _remove_the_rest(spec: mujoco.MjSpec) -> None:
    """Remove what the import does not take over, and what may name missing files."""
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for kind in ("keys", "sensors", "actuators", "tendons", "textures"):
        for one in list(getattr(spec, kind)):
            spec.delete(one)
