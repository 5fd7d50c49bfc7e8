"""URDF: checked by name and line, and made readable for MuJoCo."""

import math
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import mujoco
import numpy as np
from lxml import etree

from uam_lab.importing.source import (
    LARGE,
    ImportRefused,
    JointFacts,
    RotorFacts,
    Source,
    XmlElement,
    refused_by_mujoco,
)

READ = (".stl", ".obj", ".msh")  # by MuJoCo
LARGEST_MESH = 100e6  # [bytes]
SEARCHED = 6  # folders above the file
WORLD, FREE = "world", "free_base"  # link and joint above the base
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
FAR = 5.0  # [m] of a joint from its parent: a length in mm
LEAST = 1e-12  # [kg], [kg m^2]
VECTORS = {"origin": ("xyz", "rpy"), "axis": ("xyz",)}
TENSOR = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


class Meshes:
    """The meshes of one file. assets: name → content; files: name in the model → file."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.assets: dict[str, bytes] = {}
        self.files: dict[str, Path] = {}
        self.notes: list[str] = []
        self._names: dict[tuple[Path, str], str] = {}  # by file and scale

    def take(self, mesh: XmlElement) -> bool:
        """Find the file of a mesh element and name it as in `assets`; False: it is left out.

        Raises ImportRefused for a mesh that is as large as a house.
        """
        given = mesh.get("filename") or ""
        found = self.found(given)
        if found is None:
            return self._left_out(mesh, given, "is missing")
        if found.suffix.lower() not in READ:
            return self._left_out(mesh, given, f"is not read: {', '.join(READ)} are")
        if found.stat().st_size > LARGEST_MESH:
            return self._left_out(mesh, given, f"is larger than {LARGEST_MESH / 1e6:g} MB")
        scale = mesh.get("scale") or "1 1 1"
        if (found, scale) not in self._names:
            name = f"mesh_{len(self._names)}_{found.stem}"
            self._names[found, scale] = name + found.suffix.lower()
            self.assets[name + found.suffix.lower()] = found.read_bytes()
            self.files[name] = found
        named = self._names[found, scale]
        size = self._size(named, scale)
        if size is None:
            return self._left_out(mesh, given, "is no mesh that MuJoCo reads")
        if size > LARGE:
            where = f"{self.file} line {mesh.sourceline}"
            raise ImportRefused(f"{where}: mesh {given} is {size:.4g} m large: in mm? scale it")
        mesh.set("filename", named)
        return True

    def found(self, given: str) -> Path | None:
        """Return the file that a URDF names, also as package://NAME/x: searched in the folders
        above the URDF, with as much of the path as there is."""
        words = Path(unquote(given.split("://", 1)[-1])).parts
        whole = Path(*words) if words else Path("no name")
        above = list(self.file.absolute().parents)[:SEARCHED]
        tried = [whole, above[0] / whole]
        for begin in range(len(words) - 1):
            tried += [folder / Path(*words[begin:]) for folder in above]
        return next((one for one in tried if one.is_file()), None)

    def _left_out(self, mesh: XmlElement, given: str, why: str) -> bool:
        text = f"mesh {given} {why}: not shown"
        if not any(note.startswith(text) for note in self.notes):
            self.notes.append(f"{text} (line {mesh.sourceline})")
        return False

    def _size(self, name: str, scale: str) -> float | None:
        """Return the largest extent [m] of a mesh; None if MuJoCo does not read it."""
        spec = mujoco.MjSpec()
        try:
            spec.add_mesh(name="one", file=name, scale=np.array(scale.split(), dtype=float))
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="one", contype=0)
            spec.assets = {name: self.assets[name]}
            return float(2.0 * spec.compile().geom_aabb[0, 3:].max())
        except ValueError:
            return None


def read(file: Path, root: XmlElement) -> Source:
    """Return the source of a URDF. Raises ImportRefused."""
    return _Urdf(file, root).source()


class _Urdf:
    def __init__(self, file: Path, root: XmlElement) -> None:
        self.file, self.root = file, root
        self.links = self._named("link")
        self.joints = self._named("joint")
        if not self.links:
            raise self.error(root, "no link")

    def source(self) -> Source:
        """Check the file; return it as MuJoCo reads it."""
        for one in self.root.iter(etree.Element):
            self._check_numbers(one)
        for name, link in self.links.items():
            self._check_inertial(name, link)
        self._free(self._check_tree())
        for link in self.root.findall("link"):
            if link.get("name") != WORLD:
                _fill(link)
        meshes = Meshes(self.file)
        for mesh in list(self.root.iter("mesh")):
            if not meshes.take(mesh):
                shape = mesh.getparent().getparent()  # visual or collision
                shape.getparent().remove(shape)
        lines = {
            (kind, name): self.where(one)
            for kind, there in (("body", self.links), ("joint", self.joints))
            for name, one in there.items()
        }
        facts = {name: self._facts(one) for name, one in self.joints.items()}
        rotors = dict(_gazebo_rotors(self.root))
        for old in list(self.root.iter("gazebo", "transmission", "mujoco")):
            old.getparent().remove(old)
        how = {"fusestatic": "false", "discardvisual": "false", "strippath": "false"}
        etree.SubElement(etree.SubElement(self.root, "mujoco"), "compiler", how)
        text = etree.tostring(self.root, encoding="unicode")
        try:
            spec = mujoco.MjSpec.from_string(text, assets=meshes.assets)
        except ValueError as error:
            raise refused_by_mujoco(self.file, lines, error) from None
        return Source(self.file, spec, lines, meshes.files, rotors, facts, meshes.notes)

    def where(self, element: XmlElement) -> str:
        return f"{self.file} line {element.sourceline}"

    def error(self, element: XmlElement, text: str) -> ImportRefused:
        return ImportRefused(f"{self.where(element)}: {text}")

    def _named(self, kind: str) -> dict[str, XmlElement]:
        """Return name → element of the links or joints."""
        found: dict[str, XmlElement] = {}
        for one in self.root.findall(kind):
            name = one.get("name")
            if not name:
                raise self.error(one, f"a {kind} without a name")
            if name in found:
                first = found[name].sourceline
                raise self.error(one, f"{kind} '{name}' is there twice, first in line {first}")
            found[name] = one
        return found

    def _numbers(self, one: XmlElement, key: str, count: int) -> list[float]:
        """Return the finite numbers of an attribute, zeros without it."""
        text = one.get(key)
        try:
            values = [float(word) for word in text.split()] if text is not None else [0.0] * count
        except ValueError:
            values = []
        if len(values) != count or not all(map(math.isfinite, values)):
            many = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self.error(one, f"<{one.tag} {key}={text!r}>: {many} expected")
        return values

    def _check_numbers(self, one: XmlElement) -> None:
        for key in VECTORS.get(one.tag, ()):
            values = self._numbers(one, key, 3)
            far = max(map(abs, values)) if key == "xyz" and one.tag == "origin" else 0.0
            if far > FAR:
                raise self.error(one, f"<origin> {far:g} m away: lengths in mm? m are expected")
        if one.tag == "limit":
            for key in one.keys():
                self._numbers(one, key, 1)

    def _check_inertial(self, name: str, link: XmlElement) -> None:
        inertial = link.find("inertial")
        if inertial is None:
            return
        mass, tensor = inertial.find("mass[@value]"), inertial.find("inertia")
        if tensor is None and mass is not None and self._numbers(mass, "value", 1) == [0.0]:
            link.remove(inertial)  # a frame
            return
        if mass is None or tensor is None:
            lacks = "mass value" if mass is None else "inertia"
            raise self.error(inertial, f"link '{name}': <inertial> without <{lacks}>")
        (value,) = self._numbers(mass, "value", 1)
        if value < 0.0:
            raise self.error(mass, f"link '{name}': mass {value:g} kg is below 0")
        for key in TENSOR:
            self._numbers(tensor, key, 1)

    def _check_tree(self) -> str:
        """Return the name of the only root; raise ImportRefused for another graph than a tree."""
        above: dict[str, XmlElement] = {}
        for name, joint in self.joints.items():
            if joint.get("type") not in KINDS:
                allowed = ", ".join(KINDS)
                raise self.error(joint, f"joint '{name}': type {joint.get('type')!r}; {allowed}")
            for end in ("parent", "child"):
                named = joint.find(end)
                if named is None or named.get("link") not in self.links:
                    link = None if named is None else named.get("link")
                    raise self.error(joint, f"joint '{name}': {end} '{link}' is no link")
            child = joint.find("child").get("link")
            if child in above:
                other = above[child].get("name")
                raise self.error(joint, f"link '{child}' hangs on joints '{other}' and '{name}'")
            above[child] = joint
            self._check_joint(name, joint)
        roots = [name for name in self.links if name not in above]
        if len(roots) > 1:
            names = ", ".join(f"'{n}' (line {self.links[n].sourceline})" for n in roots)
            raise self.error(self.links[roots[1]], f"several roots: {names}; one is possible")
        seen = set(self._below(roots[0])) if roots else set()
        if len(seen) < len(self.links):
            looped = next(name for name in self.links if name not in seen)
            raise self.error(above[looped], f"joint '{above[looped].get('name')}' closes a cycle")
        return roots[0]

    def _below(self, root: str) -> Iterator[str]:
        children: dict[str, list[str]] = {}
        for joint in self.joints.values():
            pair = joint.find("parent").get("link"), joint.find("child").get("link")
            children.setdefault(pair[0], []).append(pair[1])
        waiting = [root]
        while waiting:
            name = waiting.pop()
            yield name
            waiting += children.get(name, ())

    def _check_joint(self, name: str, joint: XmlElement) -> None:
        axis, limit = joint.find("axis"), joint.find("limit")
        turns = joint.get("type") in ("revolute", "continuous", "prismatic")
        if turns and axis is not None and not any(self._numbers(axis, "xyz", 3)):
            raise self.error(axis, f"joint '{name}': an axis of zeros")
        if limit is None or joint.get("type") not in ("revolute", "prismatic"):
            return
        low, high = (self._numbers(limit, key, 1)[0] for key in ("lower", "upper"))
        if low > high:
            raise self.error(limit, f"joint '{name}': lower {low:g} is above upper {high:g}")

    def _free(self, root: str) -> None:
        """Let the base float: below a link `world`, which is MuJoCo's own."""
        hung = [j for j in self.joints.values() if j.find("parent").get("link") == root]
        massless = self.links[root].find("inertial") is None and len(hung) == 1
        if massless and (root == WORLD or hung[0].get("type") == "floating"):
            hung[0].set("type", "floating")
            hung[0].find("parent").set("link", WORLD)
            self.links[root].set("name", WORLD)
            return
        if WORLD in self.links:
            raise self.error(self.links[WORLD], f"link '{WORLD}' is the name of the surroundings")
        etree.SubElement(self.root, "link", name=WORLD)
        joint = etree.SubElement(self.root, "joint", name=FREE, type="floating")
        etree.SubElement(joint, "parent", link=WORLD)
        etree.SubElement(joint, "child", link=root)

    def _facts(self, joint: XmlElement) -> JointFacts:
        limit = joint.find("limit")
        effort = speed = 0.0
        if limit is not None:
            effort, speed = (self._numbers(limit, key, 1)[0] for key in ("effort", "velocity"))
        return JointFacts(effort, speed, joint.find("mimic") is not None)


def _fill(link: XmlElement) -> None:
    """Give a frame without mass, and a point mass, the least that MuJoCo accepts."""
    inertial = link.find("inertial")
    if inertial is None:
        inertial = etree.SubElement(link, "inertial")
        etree.SubElement(inertial, "mass", value="0")
        etree.SubElement(inertial, "inertia", dict.fromkeys(TENSOR, "0"))
    mass, tensor = inertial.find("mass[@value]"), inertial.find("inertia")
    if float(mass.get("value")) < LEAST:
        mass.set("value", f"{LEAST:g}")
    if not any(float(tensor.get(key, "0")) for key in TENSOR):
        for key in ("ixx", "iyy", "izz"):
            tensor.set(key, f"{LEAST:g}")


def _gazebo_rotors(root: XmlElement) -> Iterator[tuple[str, RotorFacts]]:
    """Yield link or joint and facts of the motor plugins of Gazebo: of RotorS, of PX4."""
    for plugin in root.iter("plugin"):
        texts = {one.tag: (one.text or "").strip() for one in plugin if isinstance(one.tag, str)}
        if "motorConstant" not in texts:
            continue
        value = {key: _number(text) for key, text in texts.items()}
        coefficient, speed = value["motorConstant"], value.get("maxRotVelocity")
        turn = texts.get("turningDirection")
        facts = RotorFacts(
            counter_clockwise=None if turn not in ("cw", "ccw") else turn == "ccw",
            thrust_max=coefficient * speed**2 if coefficient and speed else None,
            moment_ratio=value.get("momentConstant"),
            lag_up=value.get("timeConstantUp"),
            lag_down=value.get("timeConstantDown"),
            coefficient=coefficient,
            speed_max=speed,
        )
        for key in ("linkName", "jointName"):
            if key in texts:
                yield texts[key], facts


def _number(text: str) -> float | None:
    """Return a positive number, None for another text."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0.0 < value < math.inf else None
