"""Markers around the vehicle: paths, payload, drop point, magnet, phase.

A marker in a moving frame moves with /tf; it is sent again only when it changes.
"""

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from uam_control.coordinates import ALPHA, CHI, POSITION
from uam_control.mission import Scenario
from uam_control.mission.motion.trajectory import reference_rows
from uam_msgs_py.messages.ros_time import set_stamp
from uam_msgs_py.messages.status import MissionStatus
from uam_msgs_py.messages.topics import BODY, WORLD
from uam_sim_bridge.plant.frames import Box

PAYLOAD, MAGNET = "payload", "magnet"  # frames
PATH_STEP = 0.2  # [s] of mission time between two points of a path
PATH_POINTS = 2000  # of a path, at most: a flight of hours must not make its messages large
LINE_WIDTH, TEXT_HEIGHT, TEXT_ABOVE = 0.01, 0.08, 0.35  # [m]
DROP_RADIUS, MAGNET_MARGIN = 0.06, 0.004  # [m]
AHEAD, FLOWN = (0.95, 0.55, 0.10, 0.9), (0.12, 0.37, 0.66, 0.95)
CUBE, TARGET, TEXT = (0.10, 0.55, 0.35, 1.0), (0.80, 0.15, 0.15, 0.8), (0.1, 0.1, 0.1, 1.0)
ENERGISED, OFF, FAILED = (0.15, 0.90, 0.25, 0.9), (0.45, 0.45, 0.45, 0.6), (0.8, 0.1, 0.1, 1.0)


class ReferencePath:
    """The path of a scenario; each point is sampled once, when it is shown first."""

    def __init__(self, scenario: Scenario, start: np.ndarray):
        """start: chi (6 + n,) at take-off, SI units."""
        landing = scenario.begun_at(start).landing
        self._times = np.arange(0.0, landing.end + PATH_STEP, PATH_STEP)
        self._points = np.empty((len(self._times), 3))
        self._sampled = 0  # points so far
        self._trajectory, self._joints = scenario.trajectory(start), len(start) - ALPHA

    def ahead(self, time: float) -> np.ndarray:
        """Return the next PATH_POINTS points (n, 3) [m, world] from mission time [s] on."""
        begin = int(np.searchsorted(self._times, time))
        end = min(begin + PATH_POINTS, len(self._times))
        new = slice(self._sampled, end)
        if new.start < new.stop:
            rows = reference_rows(self._trajectory, self._times[new], self._joints)
            self._points[new] = rows[CHI][:, POSITION]
            self._sampled = end
        return self._points[begin:end]


class FlownPath:
    """The flown path; beyond PATH_POINTS every second point is removed."""

    def __init__(self) -> None:
        self._points: list[np.ndarray] = []
        self._step, self._due = round(PATH_STEP * 1e9), 0  # [ns]

    def add(self, stamp: int, position: np.ndarray) -> None:
        """Add the position (3,) [m, world] at `stamp` [ns]."""
        if stamp < self._due:
            return
        self._due = stamp + self._step
        self._points.append(position.copy())
        if len(self._points) > PATH_POINTS:
            del self._points[1::2]
            self._step *= 2

    @property
    def points(self) -> np.ndarray:
        """Points (n, 3) [m, world], oldest first."""
        return np.array(self._points).reshape(-1, 3)


class Markers:
    """Builds the MarkerArray of one stamp."""

    def __init__(self, scenario: Scenario, face: Box | None, payload: Box, prefix: str = ""):
        """face: of the magnet, in frame MAGNET, None without one; payload: in frame PAYLOAD;
        prefix: of frames."""
        self._drop, self._face, self._payload = scenario.drop_point, face, payload
        self._prefix = prefix

    def message(
        self,
        stamp: int,
        status: MissionStatus,
        ahead: np.ndarray,
        flown: np.ndarray,
        payload: bool,
    ) -> MarkerArray:
        """Return all markers. ahead, flown: points (n, 3) [m, world]; payload: its frame exists."""
        markers = [
            _line(stamp, "reference path", ahead, AHEAD),
            _line(stamp, "flown path", flown, FLOWN),
            _text(stamp, self._prefix + BODY, status),
        ]
        if self._face is not None:
            markers.append(self._magnet(stamp, self._face, status.magnet))
        if self._drop is not None:
            markers.append(_disc(stamp, self._drop))
        if payload:
            markers.append(_box(stamp, "payload", self._prefix + PAYLOAD, self._payload, CUBE))
        return MarkerArray(markers=markers)

    def _magnet(self, stamp: int, face: Box, on: bool) -> Marker:
        around = Box(face.centre, face.edges + MAGNET_MARGIN)
        colour = ENERGISED if on else OFF
        return _box(stamp, "magnet", self._prefix + MAGNET, around, colour)


def _marker(
    stamp: int, name: str, frame: str, kind: int, scale: Sequence[float], colour: Sequence[float]
) -> Marker:
    marker = Marker(ns=name, type=kind, action=Marker.ADD, frame_locked=frame != WORLD)
    marker.header.frame_id = frame
    set_stamp(marker.header.stamp, stamp)
    marker.pose.orientation.w = 1.0
    marker.scale.x, marker.scale.y, marker.scale.z = (float(length) for length in scale)
    marker.color = ColorRGBA(**dict(zip("rgba", colour, strict=True)))
    return marker


def _line(stamp: int, name: str, points: np.ndarray, colour: Sequence[float]) -> Marker:
    scale = (LINE_WIDTH, 0.0, 0.0)
    marker = _marker(stamp, name, WORLD, Marker.LINE_STRIP, scale, colour)
    if len(points) < 2:
        marker.action = Marker.DELETE
    else:
        marker.points = [Point(x=x, y=y, z=z) for x, y, z in points.tolist()]
    return marker


def _box(stamp: int, name: str, frame: str, box: Box, colour: Sequence[float]) -> Marker:
    marker = _marker(stamp, name, frame, Marker.CUBE, box.edges, colour)
    _place(marker, box.centre)
    return marker


def _disc(stamp: int, place: tuple[float, float]) -> Marker:
    scale = (2.0 * DROP_RADIUS, 2.0 * DROP_RADIUS, 0.004)
    marker = _marker(stamp, "drop point", WORLD, Marker.CYLINDER, scale, TARGET)
    _place(marker, (*place, 0.0))
    return marker


def _text(stamp: int, frame: str, status: MissionStatus) -> Marker:
    colour, scale = FAILED if status.abort_reason else TEXT, (0.0, 0.0, TEXT_HEIGHT)
    marker = _marker(stamp, "phase", frame, Marker.TEXT_VIEW_FACING, scale, colour)
    _place(marker, (0.0, 0.0, TEXT_ABOVE))
    marker.text = status.summary
    return marker


def _place(marker: Marker, at: Sequence[float]) -> None:
    position = marker.pose.position
    position.x, position.y, position.z = (float(x) for x in at)
