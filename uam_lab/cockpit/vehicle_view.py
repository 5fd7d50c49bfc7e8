"""The 3-D scene: frames of /tf, the robot's shapes in them, and the markers."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import viser
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from uam_control.maths.rotations import matrix_from_quaternion, quaternion_from_euler
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.tf_message import Transform
from uam_msgs_py.messages.topics import WORLD

GREY = (0.6, 0.6, 0.6, 1.0)
REFERENCE = "reference"  # frame of the desired pose
MOST_FRAMES = 200  # and markers: anyone may publish new ones without end
GROUND = 12.0  # [m] edge of the floor shown
CELL = 0.25  # [m]
AXES = 0.12  # [m] of the reference frame


@dataclass(frozen=True)
class Shape:
    """A shape in the frame of its link."""

    link: str
    kind: str  # box, cylinder or sphere
    size: np.ndarray  # edges (3,), (radius, length) or (radius,) [m]
    position: np.ndarray  # (3,) [m]
    quaternion: np.ndarray  # [w x y z]
    colour: tuple[float, ...]  # red, green, blue, opacity, 0..1


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
                said = visual.find("material/color")
                colour = GREY if said is None else tuple(_numbers(said.get("rgba"), 4).tolist())
                size = np.concatenate([_numbers(geometry.get(name), 0) for name in names])
                yield Shape(link.get("name", ""), kind, size, *_place(visual), colour)


def _place(visual: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
    origin = visual.find("origin")
    place = {} if origin is None else origin.attrib
    turn = quaternion_from_euler(_numbers(place.get("rpy"), 3))
    return _numbers(place.get("xyz"), 3), turn


def _numbers(text: str | None, count: int) -> np.ndarray:
    """Return the numbers of an attribute; zeros (count,) if it is missing. Raises ValueError."""
    return np.zeros(count) if text is None else np.array(text.split(), dtype=float)


class VehicleView:
    """Shows the last messages in viser's scene. A frame appears when its parent is known."""

    def __init__(self, scene: viser.SceneApi, prefix: str = ""):
        """prefix: of the vehicle's frames; links of the URDF have none."""
        self._prefix = prefix
        self._scene = scene
        self._paths: dict[str, str] = {WORLD: f"/{WORLD}"}
        self._frames: dict[str, viser.FrameHandle] = {}
        self._parents: dict[str, str] = {}  # of the frames
        self._orphans: dict[str, Transform] = {}  # by child: the newest whose parent is unknown
        self._shapes: dict[str, list[Shape]] = {}
        self._markers: dict[str, Any] = {}
        self._lines: dict[str, bytes] = {}
        self.vehicle = np.zeros(3)  # position [m, world] of the vehicle's base frame
        scene.add_grid(
            f"/{WORLD}/ground", width=GROUND, height=GROUND, cell_size=CELL, section_size=1.0
        )

    def describe(self, message: String) -> None:
        """Take the URDF of a std_msgs/String."""
        by_link: dict[str, list[Shape]] = {}
        for shape in shapes(message.data):
            by_link.setdefault(shape.link, []).append(shape)
        self._shapes = by_link
        for link in by_link:
            if link in self._frames:
                self._dress(link)

    def transforms(self, transforms: list[Transform]) -> None:
        """Apply transforms of /tf or /tf_static."""
        for transform in transforms:
            own = replace(
                transform, parent=self._own(transform.parent), child=self._own(transform.child)
            )
            if own.child == WORLD:  # all others are placed in it
                continue
            if own.parent in self._paths:
                self._orphans.pop(own.child, None)
                self._place(own.child, own)
            elif own.child in self._orphans or len(self._orphans) < MOST_FRAMES:
                self._orphans[own.child] = own
        placed = True
        while placed:
            placed = [c for c, t in self._orphans.items() if t.parent in self._paths]
            for child in placed:
                self._place(child, self._orphans.pop(child))

    def place(self, frame: str) -> np.ndarray | None:
        """Return the place (3,) [m, world] of a frame, None for one that is not shown."""
        found = np.zeros(3) if frame in self._frames else None
        while frame in self._frames:
            step = self._frames[frame]
            found = matrix_from_quaternion(np.array(step.wxyz)) @ found + step.position
            frame = self._parents[frame]
        return found

    def _own(self, frame: str) -> str:
        """Return a frame's name without the vehicle's prefix."""
        return frame.removeprefix(self._prefix)

    def _place(self, child: str, transform: Transform) -> None:
        position, wxyz = transform.position, transform.quaternion
        if not np.isfinite(position.sum() + wxyz.sum()):
            return
        if child not in self._frames:
            if len(self._frames) >= MOST_FRAMES:
                raise BadMessage(f"frame {child}: {MOST_FRAMES} frames are shown already")
            path = self._paths[child] = f"{self._paths[transform.parent]}/{child}"
            self._parents[child] = transform.parent
            self._frames[child] = self._scene.add_frame(
                path, show_axes=child == REFERENCE, axes_length=AXES, axes_radius=AXES / 24.0
            )
            self._dress(child)
        frame = self._frames[child]
        frame.position, frame.wxyz = position, wxyz
        if transform.parent == WORLD and child in self._shapes:
            self.vehicle = position

    def _dress(self, link: str) -> None:
        for number, shape in enumerate(self._shapes.get(link, ())):
            name = f"{self._paths[link]}/shape_{number}"
            look = {
                "color": tuple(round(255 * part) for part in shape.colour[:3]),
                "opacity": shape.colour[3] if shape.colour[3] < 1.0 else None,
                "position": shape.position,
                "wxyz": shape.quaternion,
            }
            if shape.kind == "box":
                self._scene.add_box(name, dimensions=tuple(shape.size), **look)
            elif shape.kind == "cylinder":
                radius, length = shape.size
                self._scene.add_cylinder(name, radius=radius, height=length, **look)
            else:
                self._scene.add_icosphere(name, radius=shape.size[0], **look)

    def markers(self, message: MarkerArray) -> None:
        """Show a visualization_msgs/MarkerArray, with the types used by the scene node."""
        for marker in message.markers:
            name, frame = marker.ns, self._own(marker.header.frame_id)
            if marker.action == Marker.DELETE:
                if name in self._markers:
                    self._markers.pop(name).remove()
                    self._lines.pop(name, None)
            elif frame in self._paths:
                if name not in self._markers and len(self._markers) >= MOST_FRAMES:
                    raise BadMessage(f"marker {name}: {MOST_FRAMES} are shown already")
                self._show(f"{self._paths[frame]}/{name.replace(' ', '_')}", marker)

    def _show(self, path: str, marker: Marker) -> None:
        name, at, scale, paint = marker.ns, marker.pose.position, marker.scale, marker.color
        tones, position = (paint.r, paint.g, paint.b, paint.a), (at.x, at.y, at.z)
        if not np.isfinite([*tones, *position, scale.x, scale.y, scale.z]).all():
            raise BadMessage(f"marker {name}: a number is not finite")
        colour = tuple(round(255 * part) for part in tones[:3])
        look = {"color": colour, "opacity": paint.a, "position": position}
        if marker.type == Marker.LINE_STRIP:
            points = np.array([[p.x, p.y, p.z] for p in marker.points], dtype=np.float32)
            if self._lines.get(name) == points.tobytes():
                return
            self._lines[name] = points.tobytes()
            segments = np.stack([points[:-1], points[1:]], axis=1)
            self._markers[name] = self._scene.add_line_segments(
                path, points=segments, colors=colour, line_width=3.0
            )
        elif marker.type == Marker.CUBE:
            edges = (scale.x, scale.y, scale.z)
            self._markers[name] = self._scene.add_box(path, dimensions=edges, **look)
        elif marker.type == Marker.CYLINDER:
            size = {"radius": scale.x / 2.0, "height": scale.z}
            self._markers[name] = self._scene.add_cylinder(path, **size, **look)
        elif marker.type == Marker.TEXT_VIEW_FACING:
            self._markers[name] = self._scene.add_label(path, marker.text, position=position)
