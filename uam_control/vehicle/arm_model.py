"""Masses and lengths of the arm, read from the vehicle's MJCF, and the joint torques they need.

Only the parts that this needs are read: bodies, hinges and geoms with a mass, and their classes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from uam_control.vehicle.description import VehicleDescription
from uam_control.vehicle.loading import VehicleError

TIP = "magnet"  # body that carries the payload
FACE = "magnet_face"  # its site, where the payload hangs
ENDLESS = re.compile(r"(?i)(^|\s)[-+]?(nan|inf|infinity)(\s|$)")
STRAIGHT = 1e-3  # [m] and [1] by which a planar arm may differ


class UnreadableModel(VehicleError):
    """An MJCF file that is missing, no XML, or has no numbers where numbers belong."""


@dataclass(frozen=True)
class Link:
    """One link of the arm, in the frame of its joint.

    offset (3,) [m]: of the joint in the frame of the link before (of the base); axis (3,): unit
    vector; mass [kg]; centre (3,) [m]: of the mass.
    """

    offset: np.ndarray
    axis: np.ndarray
    mass: float
    centre: np.ndarray


@dataclass(frozen=True)
class ArmModel:
    """The arm: links from base to tip; tip (3,) [m]: of the payload, in the last link's frame.

    armature [kg m^2], damping [N m s/rad], friction [N m]: of every joint.
    """

    links: tuple[Link, ...]
    tip: np.ndarray
    armature: float
    damping: float
    friction: float

    @classmethod
    def of(cls, vehicle: VehicleDescription) -> ArmModel:
        """Read the arm of a vehicle.

        Raises VehicleError if its MJCF has another form, UnreadableModel if it has none.
        """
        try:
            return _Reader(vehicle).arm()
        except VehicleError:
            raise
        except FileNotFoundError as error:
            text = f"{error.filename} does not exist, which it includes"
        except (ElementTree.ParseError, OSError, ValueError, TypeError) as error:
            text = str(error)
        except RecursionError:
            text = "it includes itself"
        raise UnreadableModel(f"{vehicle.model}: {text}")

    def planar(self, gravity: float) -> dict[str, Any]:
        """Return the parameters of `ArmLoadParameters`; {} for an arm that is not planar.

        Planar: all axes are the body's -y, and at zero every link hangs straight down.
        """
        lengths = [*(link.offset for link in self.links[1:]), self.tip]
        straight = [*lengths, *(link.centre for link in self.links)]
        turned = [link.axis - (0.0, -1.0, 0.0) for link in self.links]
        if np.any(np.abs([*turned, *(part * (1.0, 1.0, 0.0) for part in straight)]) > STRAIGHT):
            return {}
        return {
            "link_masses": [round(link.mass, 6) for link in self.links],
            "link_centres": [round(-float(link.centre[2]), 6) for link in self.links],
            "link_lengths": [round(-float(part[2]), 6) for part in lengths],
            "arm_gravity": gravity,
            "joint_armature": self.armature,
            "joint_damping": self.damping,
            "joint_friction": self.friction,
        }

    def torques(
        self,
        times: np.ndarray,
        position: np.ndarray,
        rotation: np.ndarray,
        angles: np.ndarray,
        gravity: float,
        payload: np.ndarray,
    ) -> np.ndarray:
        """Return the joint torques (m, n) [N m] of a motion, with point masses.

        times (m,) [s], equidistant; position (m, 3) [m, world] and rotation (m, 3, 3) [body to
        world] of the base; angles (m, n) [rad]; gravity [m/s^2]; payload (m,): carried mass [kg].
        """
        origins, axes, centres = self._places(position, rotation, angles)
        masses = [np.full(len(times), link.mass) for link in self.links]
        masses.append(payload)
        up = np.array([0.0, 0.0, gravity])
        forces = [
            mass[:, None] * (_derived(_derived(centre, times), times) + up)
            for mass, centre in zip(masses, centres, strict=True)
        ]
        rates = _derived(angles, times)
        own = (
            self.armature * _derived(rates, times)
            + self.damping * rates
            + self.friction * np.sign(np.round(rates, 6))
        )
        found = np.empty_like(angles)
        for i in range(len(self.links)):
            moment = sum(
                np.cross(centre - origins[i], force)
                for centre, force in zip(centres[i:], forces[i:], strict=True)
            )
            found[:, i] = np.einsum("ij,ij->i", moment, axes[i])
        return found + own

    def holding_torques(self, angles: np.ndarray, gravity: float, payload: float) -> np.ndarray:
        """Return the joint torques (n,) [N m] that hold the arm of a level base.

        angles (n,) [rad]; gravity [m/s^2]; payload [kg] at the tip.
        """
        still = np.repeat(np.asarray(angles, dtype=float)[None], 3, axis=0)
        base, level = np.zeros((3, 3)), np.repeat(np.eye(3)[None], 3, axis=0)
        times, carried = np.arange(3.0), np.full(3, payload)
        return self.torques(times, base, level, still, gravity, carried)[1]

    def payload_acceleration(
        self, times: np.ndarray, position: np.ndarray, rotation: np.ndarray, angles: np.ndarray
    ) -> np.ndarray:
        """Return the acceleration (m, 3) [m/s^2, world] of the payload; see `torques`."""
        payload = self._places(position, rotation, angles)[2][-1]
        return _derived(_derived(payload, times), times)

    def _places(
        self, position: np.ndarray, rotation: np.ndarray, angles: np.ndarray
    ) -> tuple[list[np.ndarray], ...]:
        """Return joints [m], their axes [1], and centres of the links and the payload [m].

        Lists of (m, 3) in the world frame; arguments: see `torques`.
        """
        origins, axes, centres = [], [], []
        place, frame = position, rotation
        for i, link in enumerate(self.links):
            place = place + frame @ link.offset
            origins.append(place)
            axes.append(frame @ link.axis)
            frame = frame @ _about(link.axis, angles[:, i])
            centres.append(place + frame @ link.centre)
        centres.append(place + frame @ self.tip)
        return origins, axes, centres


def _derived(values: np.ndarray, times: np.ndarray) -> np.ndarray:
    return np.gradient(values, times, axis=0)


def _about(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the rotations (m, 3, 3) about a unit axis (3,) by angles (m,) [rad]."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, rest = np.sin(angles)[:, None, None], (1.0 - np.cos(angles))[:, None, None]
    return np.eye(3) + sine * cross + rest * (cross @ cross)


class _Reader:
    """Reads an MJCF file with its includes."""

    def __init__(self, vehicle: VehicleDescription) -> None:
        self._file, self._names = vehicle.model, vehicle.joint_names
        self._root = _included(vehicle.model, vehicle.model.parent)
        self._classes = {
            (one.get("class"), part.tag): part.attrib
            for one in self._root.iter("default")
            if one.get("class")
            for part in one
        }

    def arm(self) -> ArmModel:
        """Return the arm."""
        bodies = {}
        parents = {child: parent for parent in self._root.iter() for child in parent}
        for body in self._root.iter("body"):
            for joint in body.findall("joint"):
                if joint.get("name") in bodies and joint.get("name") in self._names:
                    raise ValueError(f"two joints '{joint.get('name')}'")
                bodies[joint.get("name")] = (body, joint)
        if missing := [name for name in self._names if name not in bodies]:
            attached = any(self._root.iter("attach"))  # a part that is not read here may have it
            kind = VehicleError if attached else UnreadableModel
            raise kind(f"{self._file}: no joint '{missing[0]}'")
        links = []
        for name in self._names:
            body, joint = bodies[name]
            attributes = self._attributes(joint)
            mass, centre = self._mass(body)
            axis = _vector(attributes.get("axis", "0 0 1"))
            links.append(
                Link(_vector(body.get("pos", "0 0 0")), axis / np.linalg.norm(axis), mass, centre)
            )
        tip = next((body for body in self._root.iter("body") if body.get("name") == TIP), None)
        if tip is None or parents[tip] is not body:
            raise VehicleError(f"{self._file}: the last link has no body '{TIP}'")
        face = next((one for one in tip.iter("site") if one.get("name") == FACE), None)
        hangs = _vector(tip.get("pos", "0 0 0"))
        if face is not None:
            hangs = hangs + _vector(face.get("pos", "0 0 0"))
        values = (float(attributes.get(key, 0)) for key in ("armature", "damping", "frictionloss"))
        return ArmModel(tuple(links), hangs, *values)

    def _attributes(self, part: ElementTree.Element) -> dict[str, str]:
        return {**self._classes.get((part.get("class"), part.tag), {}), **part.attrib}

    def _mass(self, body: ElementTree.Element) -> tuple[float, np.ndarray]:
        """Return mass [kg] and centre (3,) [m] of a body and of the tip that hangs on it."""
        total, moment = 0.0, np.zeros(3)
        for part in (*body.findall("inertial"), *body.findall("geom")):
            attributes = self._attributes(part)
            if "mass" not in attributes:
                raise VehicleError(f"{self._file}: body '{body.get('name')}': a part without mass")
            mass = float(attributes["mass"])
            if mass < 0.0:
                raise ValueError(f"body '{body.get('name')}': mass {mass:g} kg is below 0")
            centre = _vector(attributes.get("pos", "0 0 0"))
            if "fromto" in attributes:
                centre = _vector(attributes["fromto"]).reshape(2, 3).mean(axis=0)
            total, moment = total + mass, moment + mass * centre
        for child in body.findall("body"):
            if not any(joint.get("name") in self._names for joint in child.findall("joint")):
                mass, centre = self._mass(child)
                # the weight of what swings acts at its pivot
                place = _vector(child.get("pos", "0 0 0"))
                moment += mass * (place if child.find("joint") is not None else place + centre)
                total += mass
        return total, moment / total if total else moment


def _included(file: Path, folder: Path) -> ElementTree.Element:
    """Return the tree of a file; the content of its file, in `folder`, replaces an `include`."""
    root = ElementTree.parse(file).getroot()
    for one in root.iter():
        for key, text in one.attrib.items():
            if key != "name" and ENDLESS.search(text):  # MuJoCo warns of it and goes on
                raise ValueError(f"{one.tag}: {key}: {text!r} is not finite")
    for parent in list(root.iter()):
        for i, child in reversed(list(enumerate(parent))):
            if child.tag == "include":
                parent.remove(child)
                name = child.get("file")
                try:
                    parts = list(_included(folder / name, folder))
                except (ElementTree.ParseError, ValueError) as error:
                    raise ValueError(f"{name}: {error}") from None
                for part in reversed(parts):
                    parent.insert(i, part)
    return root


def _vector(text: str) -> np.ndarray:
    return np.array([float(number) for number in text.split()])
