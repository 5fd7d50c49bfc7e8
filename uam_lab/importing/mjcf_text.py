"""The vehicle's MJCF: base and arm of the file as bodies of this project, and its own magnet."""

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from lxml import etree

from uam_control.settings import configuration
from uam_control.settings.atomic import copy, write_text
from uam_lab.importing import geometry
from uam_lab.importing.source import XmlElement
from uam_lab.importing.standing import Stance
from uam_lab.importing.structure import OWN, Parts

INCLUDED = ("world.xml", "sensors.xml", "magnet.xml")
XM430 = 3.0  # [N m] its stall torque; its dynamics are those of parts/world.xml
WORLD_DYNAMICS = {"armature": 0.010, "damping": 0.02, "frictionloss": 0.08}  # of an XM430-W210
KINDS = {
    geometry.SHAPES.mjGEOM_SPHERE: ("sphere", 1),
    geometry.SHAPES.mjGEOM_CAPSULE: ("capsule", 2),
    geometry.SHAPES.mjGEOM_CYLINDER: ("cylinder", 2),
    geometry.SHAPES.mjGEOM_ELLIPSOID: ("ellipsoid", 3),
    geometry.SHAPES.mjGEOM_BOX: ("box", 3),
}
END_EFFECTOR = "end_effector"  # its site, without a magnet
NOTHING = 1e-12  # what rounding leaves of a zero
BOOM, LEG = "0.010", "0.006"  # [m] radius
SHORT = 1e-3  # [m] of a bar that is left out
HIDDEN = "3"  # geom group that is not drawn


class MjcfText:
    """Writes the MJCF of a vehicle and the parts and meshes that it includes."""

    def __init__(self, parts: Parts, stance: Stance, folder: Path, stall: Sequence[float]) -> None:
        """stall (n,) [N m]: stall torque of the servo of each joint."""
        self.parts, self.stance, self.folder = parts, stance, folder
        self._gears = dict(zip(parts.joints, np.divide(stall, XM430), strict=True))
        self._assets: dict[str, dict[str, str]] = {}
        self._taken = {"base", *OWN, "magnet_case"}

    def write(self, name: str) -> Path:
        """Write NAME.xml, parts/ and meshes/; return the file."""
        (self.folder / "parts").mkdir(parents=True, exist_ok=True)
        for part in INCLUDED:
            copy(configuration.path(f"vehicle/parts/{part}"), self.folder / "parts" / part)
        root = etree.Element("mujoco", model=name)
        etree.SubElement(root, "include", file="parts/world.xml")
        assets = etree.SubElement(root, "asset")
        world = etree.SubElement(root, "worldbody")
        base = etree.SubElement(world, "body", name="base", pos=text([0, 0, self.stance.height]))
        etree.SubElement(base, "freejoint", name="base")
        self._body(base, 0)
        etree.SubElement(base, "site", name="imu", pos="0 0 0", size="0.005", rgba="0 0 0 0")
        self._feet(base)
        self._arm(base)
        etree.SubElement(root, "include", file="parts/sensors.xml")
        for attributes in self._assets.values():
            etree.SubElement(assets, "mesh", attributes)
        if not self._assets:
            root.remove(assets)
        etree.indent(root)
        file = self.folder / f"{name}.xml"
        head = f"<!-- {self.parts.source.file.name}, imported by uam vehicle import. -->\n"
        write_text(file, head + etree.tostring(root, encoding="unicode") + "\n")
        return file

    def _arm(self, base: XmlElement) -> None:
        parts, above = self.parts, base
        for link, joint in enumerate(parts.joints, 1):
            body_name = self._free_name(parts.model.body(parts.model.jnt_bodyid[joint]).name, link)
            place, axes = self._in(link - 1, *parts.frame(link))
            body = etree.SubElement(
                above, "body", name=body_name, pos=text(place), quat=text(quaternion(axes))
            )
            own = parts.frame(link)[1].T @ parts.data.xaxis[joint]
            etree.SubElement(
                body,
                "joint",
                {"name": parts.model.joint(joint).name, "class": "arm_link", "axis": text(own)}
                | self._dynamics(joint),
            )
            self._body(body, link)
            above = body
        place, axes = geometry.tip(self.parts)
        there = {"pos": text(place), "quat": text(quaternion(axes))}
        if not self.parts.magnet:
            site = {"name": END_EFFECTOR, "size": "0.004", "rgba": "0 0 0 0"}
            etree.SubElement(above, "site", site | there)
            return
        magnet = etree.SubElement(above, "body", {"name": "magnet"} | there)
        etree.SubElement(magnet, "include", file="parts/magnet.xml")

    def _free_name(self, name: str, link: int) -> str:
        name = name if name and name not in self._taken else f"arm_{link}"
        self._taken.add(name)
        return name

    def _dynamics(self, joint: int) -> dict[str, str]:
        """Return armature, damping and friction of a joint: the file's, else by the servo."""
        model, dof = self.parts.model, self.parts.model.jnt_dofadr[joint]
        stated = (model.dof_armature[dof], model.dof_damping[dof], model.dof_frictionloss[dof])
        return {
            key: f"{value if value > 0.0 else self._gears[joint] * usual:.4g}"
            for (key, usual), value in zip(WORLD_DYNAMICS.items(), stated, strict=True)
        }

    def _body(self, body: XmlElement, link: int) -> None:
        mass, centre, tensor = geometry.inertial(self.parts, link)
        six = (*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2])
        given = {"pos": text(centre), "mass": f"{mass:.9g}", "fullinertia": text(six)}
        etree.SubElement(body, "inertial", given)
        solid = geometry.shapes(self.parts, link, True)
        seen = [g for g in geometry.shapes(self.parts, link, False) if self._rgba(g)[3] > 0.0]
        body_of = self.parts.model.geom_bodyid
        bare = {*body_of[solid]} - {*body_of[seen]}  # of the file, without a shape to look at
        seen += [g for g in solid if body_of[g] in bare and self._rgba(g)[3] > 0.0]
        for geom in seen:
            self._shown(body, link, geom)
        for begin, end, radius in () if seen else self._bars(link, centre):
            self._bar(body, [*begin, *end], radius)
        if 0 < link < len(self.parts.joints):  # the last one would touch what the magnet holds
            for geom in solid:
                self._solid(body, link, geom)

    def _bars(self, link: int, centre: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, str]]:
        """Return what is seen of a link without shapes: begin, end (3,) [m], radius of each bar."""
        parts = self.parts
        if link == 0:
            return [(centre, rotor.position, BOOM) for rotor in parts.rotors]
        last = link == len(parts.joints)
        end = geometry.tip(parts)[0] if last else self._in(link, *parts.frame(link + 1))[0]
        return [(np.zeros(3), end, BOOM)] if np.linalg.norm(end) > SHORT else []

    def _in(self, link: int, place: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a place (3,) [m] and axes (3, 3) of the world in the frame of a link."""
        origin, own = self.parts.frame(link)
        return own.T @ (place - origin), own.T @ axes

    def _shown(self, body: XmlElement, link: int, geom: int) -> None:
        model = self.parts.model
        place, axes = self._in(link, *geometry.pose_of(self.parts, geom))
        look = {"pos": text(place), "quat": text(quaternion(axes)), "mass": "0"}
        look["rgba"] = text(self._rgba(geom))
        kind = KINDS.get(mujoco.mjtGeom(model.geom_type[geom]))
        if kind is None:
            look |= {"type": "mesh", "mesh": self._mesh(int(model.geom_dataid[geom]))}
        else:
            look |= {"type": kind[0], "size": text(model.geom_size[geom][: kind[1]])}
        etree.SubElement(body, "geom", look)

    def _rgba(self, geom: int) -> np.ndarray:
        model = self.parts.model
        material = model.geom_matid[geom]
        return model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]

    def _mesh(self, mesh: int) -> str:
        """Copy the file of a mesh; return its name."""
        model = self.parts.model
        name = model.mesh(mesh).name
        if name not in self._assets:
            file = self.parts.source.meshes[name]
            kept = f"{name}{file.suffix.lower()}"
            (self.folder / "meshes").mkdir(exist_ok=True)
            copy(file, self.folder / "meshes" / kept)
            scale = text(model.mesh_scale[mesh])
            self._assets[name] = {"name": name, "file": f"meshes/{kept}", "scale": scale}
            self._assets[name] |= {"inertia": "shell"}
        return name

    def _solid(self, body: XmlElement, link: int, geom: int) -> None:
        """Add a shape that touches ground and payload; a mesh by its box."""
        model, data = self.parts.model, self.parts.data
        kind = KINDS.get(mujoco.mjtGeom(model.geom_type[geom]))
        axes = data.geom_xmat[geom].reshape(3, 3)
        place, size = data.geom_xpos[geom], model.geom_size[geom]
        if kind is None:
            kind, box = KINDS[geometry.SHAPES.mjGEOM_BOX], model.geom_aabb[geom]
            place, size = place + axes @ box[:3], np.maximum(box[3:], 1e-3)
        place, axes = self._in(link, place, axes)
        shape = {"class": "arm_link", "type": kind[0], "size": text(size[: kind[1]])}
        shape |= {"pos": text(place), "quat": text(quaternion(axes)), "mass": "0"}
        etree.SubElement(body, "geom", shape | {"group": HIDDEN})

    def _bar(self, body: XmlElement, ends: list[float], radius: str) -> None:
        """Add a bar that is seen only, between two ends (6,) [m]."""
        bar = {"type": "capsule", "fromto": text(ends), "size": radius, "mass": "0"}
        etree.SubElement(body, "geom", bar | {"material": "carbon"})

    def _feet(self, base: XmlElement) -> None:
        for i, foot in enumerate(self.stance.feet, 1):
            if self.stance.legs.value:
                self._bar(base, [0.3 * foot[0], 0.3 * foot[1], 0.0, *foot], LEG)
            given = {"name": f"foot_{i}", "class": "foot", "pos": text(foot)}
            etree.SubElement(base, "geom", given)


def quaternion(axes: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,) [w x y z] of axes (3, 3)."""
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(axes).ravel())
    return found


def text(numbers: np.ndarray | list | tuple) -> str:
    """Return numbers as MJCF writes them."""
    return " ".join(f"{float(n) if abs(n) > NOTHING else 0.0:.9g}" for n in numbers)
