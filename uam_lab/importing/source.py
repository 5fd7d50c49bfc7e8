"""The file that is imported: its model in MuJoCo, and the line of each of its parts."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
from lxml import etree

from uam_control.vehicle import VehicleError

LARGEST_FILE = 20e6  # [bytes] of a description
LARGE = 20.0  # [m] of a vehicle's part: a shape in mm
NAMED = re.compile(r"(?:name|material|mesh|body|joint|link) '([^']+)'")  # in a text of MuJoCo
XmlElement = etree._Element  # lxml has no public name for its type


class ImportRefused(VehicleError):
    """A description that cannot be imported; one line: file, line, what, what is allowed."""


@dataclass
class RotorFacts:
    """What a simulator's part of the file says of a rotor; None: nothing."""

    counter_clockwise: bool | None = None  # from above
    thrust_max: float | None = None  # [N]
    moment_ratio: float | None = None  # [m]
    lag_up: float | None = None  # [s]
    lag_down: float | None = None  # [s]
    coefficient: float | None = None  # [N s^2/rad^2]
    speed_max: float | None = None  # [rad/s]


@dataclass
class JointFacts:
    """What the file says of a joint; 0: nothing."""

    effort: float = 0.0  # [N m] limit
    speed: float = 0.0  # [rad/s] limit
    mimic: bool = False  # whether it follows another one


@dataclass
class Source:
    """A description as MuJoCo reads it."""

    file: Path
    spec: mujoco.MjSpec
    lines: dict[tuple[str, str], str]
    meshes: dict[str, Path] = field(default_factory=dict)  # name in the model → file
    rotors: dict[str, RotorFacts] = field(default_factory=dict)  # by the name of link or joint
    joints: dict[str, JointFacts] = field(default_factory=dict)  # by name
    notes: list[str] = field(default_factory=list)  # what is missing

    def compiled(self) -> mujoco.MjModel:
        """Return the model; raise ImportRefused with MuJoCo's reason."""
        try:
            return self.spec.compile()
        except ValueError as error:
            raise refused_by_mujoco(self.file, self.lines, error) from None

    def error(self, kind: str, name: str, text: str) -> ImportRefused:
        """Return the error about the part `name`; kind: body or joint."""
        return ImportRefused(f"{self.where(kind, name)}: {kind} '{name}': {text}")

    def where(self, kind: str, name: str) -> str:
        """Return "file line N" of a part; the file where the part is not in `lines`."""
        return self.lines.get((kind, name), str(self.file))


def refused_by_mujoco(
    file: Path, lines: dict[tuple[str, str], str], error: ValueError
) -> ImportRefused:
    """Return the refusal with MuJoCo's reason, and the line of the part that it names."""
    reason = " ".join(str(error).removeprefix("Error: ").split())
    where = str(file)
    for name in NAMED.findall(reason):
        at = [line for (_, other), line in lines.items() if other == name]
        where = at[0] if at else where
    return ImportRefused(f"{where}: {reason}")


def tree(file: Path) -> XmlElement:
    """Return the root of an XML file; raise ImportRefused with the line of an error.

    Entities are refused: they can grow without limit and name other files.
    """
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise ImportRefused(f"{file}: larger than {LARGEST_FILE / 1e6:g} MB")
        text = file.read_bytes()
    except OSError as error:
        raise ImportRefused(f"{file}: {(error.strerror or str(error)).lower()}") from None
    for number, line in enumerate(text.splitlines(), 1):
        if b"<!DOCTYPE" in line or b"<!ENTITY" in line:
            raise ImportRefused(f"{file} line {number}: a document type or entity is not read")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        return etree.fromstring(text, parser)
    except etree.XMLSyntaxError as error:
        said = " ".join(str(error.msg).split())
        raise ImportRefused(f"{file} line {error.lineno}: no XML: {said}") from None


def kind_of(file: Path, root: XmlElement) -> str:
    """Return "robot" for a URDF, "mujoco" for an MJCF; raise ImportRefused for another file."""
    name = etree.QName(root).localname
    tags = (one.tag for one in root.iter() if isinstance(one.tag, str))
    if "xacro" in "".join(root.nsmap.values()) and any("xacro" in tag for tag in tags):
        plain = file.name.split(".")[0] + ("_plain" if file.suffix == ".urdf" else "")
        raise ImportRefused(f"{file}: xacro macros; xacro {file.name} > {plain}.urdf first")
    if name in ("robot", "mujoco"):
        return name
    other = "; for it: the file that has it" if name == "mujocoinclude" else ""
    raise ImportRefused(f"{file} line {root.sourceline}: <{name}>: URDF or MJCF expected{other}")
