"""Calibration of a tracker: its axes and the body's pivot → world ENU and body FLU.

The only place that converts between the two. With t: tracker, r: rigid body as defined in the
tracker, w: world, b: body,

    R_wb = R_wt R_tr R_rb        p_b = R_wt p_t − origin − R_wb pivot

R_wt turns the tracker's upward axis to z, then by `heading` about it.

`fit` calibrates from two places: level on the floor, then again after a straight move nose first.
At both places the vehicle is level, so its attitude is a heading alone; the way between them is the
direction of its nose. The height above the floor gives the pivot's height; its horizontal place is
not observable from these, and is stated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uam_control.maths.rotations import (
    euler_from_quaternion,
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_multiply,
    rotate,
    wrap_angle,
)
from uam_control.settings import configuration
from uam_control.settings.section import read_section
from uam_sim_bridge.devices.mocap.frame import BodyPose, MocapError
from uam_sim_bridge.devices.mocap.measurement import StillPose

FOLDER = "mocap"  # of config/
HALF = math.sqrt(0.5)
# tracker → its axes with z up [w x y z]. y up: x stays, y becomes z, z becomes -y
UPRIGHT = {"y": np.array([HALF, HALF, 0.0, 0.0]), "z": np.array([1.0, 0.0, 0.0, 0.0])}
ENTRIES = {"up", "heading_deg", "origin", "body", "pivot", "measured"}
FARTHEST = 100.0  # [m] of an origin
LONGEST = 1.0  # [m] of a pivot
SHORTEST = 0.5  # [m] between the places: 5 mm sideways are then 0.6 deg
STEEPEST = 0.02  # [m] difference of the heights
TILT = math.radians(1.0)  # between the places: an uneven floor, or not level
DEFINED_TILT = math.radians(15.0)  # of the rigid body's axes against the tracker's
TURN = math.radians(3.0)  # between the places: not moved straight
LOWEST, HIGHEST = -0.1, 0.5  # [m] of the pivot from base_link, upwards


@dataclass(frozen=True)
class Calibration:
    """From the tracker's axes and a rigid body to the world and base_link."""

    up: str  # the tracker's axis that points up, y or z
    heading: float  # [rad] about it, tracker → world
    origin: tuple[float, ...]  # (3,) [m, ENU] subtracted from positions
    body: tuple[float, ...]  # (4,) [w x y z] rotation b → r
    pivot: tuple[float, ...]  # (3,) [m, FLU] of the rigid body, from base_link
    measured: Mapping[str, float | str]  # residuals of the measurement; {}: nominal

    @property
    def world(self) -> np.ndarray:
        """Return the rotation t → w as a quaternion (4,) [w x y z]."""
        return world_rotation(self.up, self.heading)

    def convert(self, pose: BodyPose) -> tuple[np.ndarray, np.ndarray]:
        """Return position (3,) [m, ENU] and quaternion (4,) FLU → ENU, w >= 0, of base_link."""
        world = self.world
        turned = quaternion_multiply(
            quaternion_multiply(world, pose.quaternion), np.array(self.body)
        )
        turned /= math.copysign(math.sqrt(turned @ turned), turned[0])
        position = rotate(matrix_from_quaternion(world), pose.position) - np.array(self.origin)
        position -= rotate(matrix_from_quaternion(turned), np.array(self.pivot))
        return position, turned

    def without_body(self) -> Calibration:
        """Return the calibration of a body that was defined in the tracker along the world's axes.

        Its pivot is the point that is wanted: the payload.
        """
        body = conjugate(self.world)
        return Calibration(self.up, self.heading, self.origin, tuple(body), (0.0, 0.0, 0.0), {})


def world_rotation(up: str, heading: float) -> np.ndarray:
    """Return the rotation tracker → world (4,) [w x y z] for its upward axis and heading [rad]."""
    return quaternion_multiply(quaternion_from_euler(np.array([0.0, 0.0, heading])), UPRIGHT[up])


def conjugate(quaternion: np.ndarray) -> np.ndarray:
    """Return the inverse (4,) of a unit quaternion (4,) [w x y z]."""
    return quaternion * np.array([1.0, -1.0, -1.0, -1.0])


def load(name_or_file: str) -> Calibration:
    """Read a calibration of config/mocap or of a file; raises MocapError, ConfigurationError."""
    file = configuration.named(FOLDER, name_or_file)
    section = read_section(file, MocapError)
    section.only(sorted(ENTRIES))
    up = section.one_of("up", UPRIGHT)
    body, pivot = section.numbers("body", 4), section.numbers("pivot", 3)
    norm = math.sqrt(sum(value * value for value in body))
    if not abs(norm - 1.0) < 1e-3:
        raise section.error("body", f"norm {norm:.4g}, 1 expected: a unit quaternion w x y z")
    origin = section.numbers("origin", 3)
    for key, values, limit in (("pivot", pivot, LONGEST), ("origin", origin, FARTHEST)):
        if max(map(abs, values)) > limit:
            raise section.error(key, f"{list(values)} is farther than {limit:g} m")
    heading = math.radians(section.number("heading_deg"))
    measured = section.section("measured").values if "measured" in section.values else {}
    return Calibration(up, heading, origin, tuple(v / norm for v in body), pivot, measured)


def text(calibration: Calibration) -> str:
    """Return the content of a calibration file."""
    c = calibration

    def row(values: tuple[float, ...], digits: int) -> str:
        return f"[{', '.join(f'{value + 0.0:.{digits}f}' for value in values)}]"

    lines = [
        "# Motion capture: tracker's axes and rigid body -> ENU and FLU; docs/hardware.md",
        f"up: {c.up}  # axis of the tracker's world that points up",
        f"heading_deg: {math.degrees(c.heading):.6g}  # [deg] about up, tracker -> world",
        f"origin: {row(c.origin, 5)}  # [m, ENU] subtracted from positions",
        f"body: {row(c.body, 9)}  # w x y z, rotation FLU -> axes of the rigid body",
        f"pivot: {row(c.pivot, 5)}  # [m, FLU] pivot of the rigid body, from base_link",
    ]
    if c.measured:
        lines.append("measured:")
        lines += [
            f"  {name}: {value if isinstance(value, str) else format(value, '.4g')}"
            for name, value in c.measured.items()
        ]
    return "\n".join(lines) + "\n"


def fit(
    level: StillPose,
    ahead: StillPose,
    up: str,
    heading: float,
    standing: float,
    pivot: Sequence[float],
) -> Calibration:
    """Return the calibration with its residuals; raise MocapError for a measurement without sense.

    level, ahead: the two places; up, heading [rad]: see `Calibration`; standing [m]: height of
    base_link above the floor on the landing gear; pivot (2,) [m, FLU]: x, y of the rigid body's
    pivot.
    """
    world = world_rotation(up, heading)
    turn = matrix_from_quaternion(world)
    first, second = rotate(turn, level.position), rotate(turn, ahead.position)
    way = second - first
    distance = math.hypot(way[0], way[1])
    _refuse(
        abs(way[2]) > STEEPEST,
        f"moved {way[2]:+.3f} m upwards between the places, at most {STEEPEST:g} m is allowed; "
        f"is the floor level, and does the tracker's {up} axis point up?",
    )
    _refuse(
        distance < SHORTEST,
        f"moved {distance:.2f} m between the places, at least {SHORTEST:g} m are needed",
    )
    _refuse(
        (defined := _defined_tilt(world, level)) > DEFINED_TILT,
        f"the rigid body's axes are tilted by {math.degrees(defined):.0f} deg while the vehicle "
        f"stands level, at most {math.degrees(DEFINED_TILT):.0f} deg are allowed; is the vehicle "
        f"on its landing gear, does the tracker's {up} axis point up, and was the body made level?",
    )
    nose = math.atan2(way[1], way[0])
    stands = quaternion_from_euler(np.array([0.0, 0.0, nose]))
    # level: R_wb = R_wt R_tr R_rb is a heading
    body = quaternion_multiply(conjugate(quaternion_multiply(world, level.quaternion)), stands)
    body /= math.copysign(math.sqrt(body @ body), body[0])
    rough = Calibration(up, heading, (0.0, 0.0, 0.0), tuple(body), (0.0, 0.0, 0.0), {})
    place, after = rough.convert(BodyPose(ahead.position, ahead.quaternion))
    roll, pitch, yaw = euler_from_quaternion(after)
    tilt = math.acos(math.cos(roll) * math.cos(pitch))
    turned = float(wrap_angle(yaw - nose))
    _refuse(
        tilt > TILT,
        f"tilted by {math.degrees(tilt):.2f} deg between the places, at most "
        f"{math.degrees(TILT):g} deg is allowed; is the floor flat?",
    )
    _refuse(
        abs(turned) > TURN,
        f"turned by {math.degrees(turned):+.1f} deg between the places, at most "
        f"{math.degrees(TURN):g} deg are allowed; move it straight ahead",
    )
    height = 0.5 * (first[2] + second[2]) - standing
    _refuse(
        not LOWEST <= height <= HIGHEST,
        f"the pivot is {height:+.2f} m above base_link, {LOWEST:g} to {HIGHEST:g} m is allowed; is "
        f"the tracker's ground plane on the floor, and does its {up} axis point up?",
    )
    measured: dict[str, float | str] = {
        "distance_m": distance,
        "height_difference_m": float(place[2] - first[2]),
        "tilt_difference_deg": math.degrees(tilt),
        "heading_difference_deg": math.degrees(turned),
        "body_tilt_deg": math.degrees(defined),
        "spread_mm": 1e3 * max(level.spread, ahead.spread),
        "wobble_deg": math.degrees(max(level.wobble, ahead.wobble)),
        "poses": str(level.count + ahead.count),
    }
    at = (float(pivot[0]), float(pivot[1]), float(height))
    return Calibration(up, heading, (0.0, 0.0, 0.0), tuple(map(float, body)), at, measured)


def _defined_tilt(world: np.ndarray, level: StillPose) -> float:
    """Return the angle [rad] between the rigid body's upward axis and the vertical.

    Trackers make a rigid body along their own axes; one that was made while the vehicle stood level
    is upright whenever the vehicle is level.
    """
    turned = quaternion_multiply(quaternion_multiply(world, level.quaternion), conjugate(world))
    return math.acos(max(-1.0, min(1.0, matrix_from_quaternion(turned)[2, 2])))


def _refuse(wrong: bool, text: str) -> None:
    if wrong:
        raise MocapError(text)
