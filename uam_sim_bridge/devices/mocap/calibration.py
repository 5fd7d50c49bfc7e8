"""Calibration of a tracker: its axes and the body's pivot → world ENU and body FLU.

The only place that converts between the two. With t: tracker, r: rigid body as defined in the
tracker, w: world, b: body,

    R_wb = R_wt R_tr R_rb        p_b = R_wt p_t − origin − R_wb pivot

R_wt turns the tracker's upward axis to z, then by `heading` about it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_multiply,
    rotate,
)
from uam_control.settings import configuration
from uam_control.settings.section import read_section
from uam_sim_bridge.devices.mocap.frame import BodyPose, MocapError

FOLDER = "mocap"  # of config/
HALF = math.sqrt(0.5)
# tracker → its axes with z up [w x y z]. y up: x stays, y becomes z, z becomes -y
UPRIGHT = {"y": np.array([HALF, HALF, 0.0, 0.0]), "z": np.array([1.0, 0.0, 0.0, 0.0])}
ENTRIES = {"up", "heading_deg", "origin", "body", "pivot", "measured"}
FARTHEST = 100.0  # [m] of an origin
LONGEST = 1.0  # [m] of a pivot


@dataclass(frozen=True)
class Calibration:
    """up: the tracker's axis that points up, y or z; heading [rad]: about it, tracker → world.

    origin (3,) [m, ENU]: subtracted from positions; body (4,) [w x y z]: rotation b → r; pivot (3,)
    [m, FLU]: of the rigid body, from base_link; measured: residuals of the measurement, {} for a
    nominal calibration.
    """

    up: str
    heading: float
    origin: tuple[float, ...]
    body: tuple[float, ...]
    pivot: tuple[float, ...]
    measured: Mapping[str, float | str]

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
    up = section.text("up")
    if up not in UPRIGHT:
        raise section.error("up", f"'{up}' is not one of {', '.join(UPRIGHT)}")
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


def write(calibration: Calibration, file: Path) -> None:
    """Write the calibration file; raises OSError."""
    file.write_text(text(calibration), encoding="utf-8")
