"""The visual shapes of a URDF: boxes, cylinders and spheres of its links."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from uam_control.maths.rotations import quaternion_from_euler

GREY = (0.6, 0.6, 0.6, 1.0)


@dataclass(frozen=True)
class Shape:
    """A shape in the frame of its link.

    kind: box, cylinder or sphere; size: edges (3,), (radius, length) or (radius,) [m]; position
    (3,) [m]; quaternion [w x y z]; colour: red, green, blue, opacity, 0..1.
    """

    link: str
    kind: str
    size: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    colour: tuple[float, ...]


def shapes(urdf: str) -> list[Shape]:
    """Return the shapes of a URDF text without meshes; none for an invalid text."""
    try:
        robot = ElementTree.fromstring(urdf)
        return [shape for link in robot.iter("link") for shape in _of_link(link)]
    except (ElementTree.ParseError, ValueError):
        return []


def _of_link(link: ElementTree.Element) -> Iterator[Shape]:
    for visual in link.iter("visual"):
        for kind, names in (
            ("box", ("size",)),
            ("cylinder", ("radius", "length")),
            ("sphere", ("radius",)),
        ):
            geometry = visual.find(f"geometry/{kind}")
            if geometry is not None:
                size = np.concatenate([_numbers(geometry.get(name), 0) for name in names])
                yield Shape(link.get("name", ""), kind, size, *_place(visual), _colour(visual))


def _place(visual: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
    origin = visual.find("origin")
    place = {} if origin is None else origin.attrib
    turn = quaternion_from_euler(_numbers(place.get("rpy"), 3))
    return _numbers(place.get("xyz"), 3), turn


def _colour(visual: ElementTree.Element) -> tuple[float, ...]:
    colour = visual.find("material/color")
    return GREY if colour is None else tuple(_numbers(colour.get("rgba"), 4).tolist())


def _numbers(text: str | None, count: int) -> np.ndarray:
    """Return the numbers of an attribute; zeros (count,) if it is missing. Raises ValueError."""
    return np.zeros(count) if text is None else np.array(text.split(), dtype=float)
