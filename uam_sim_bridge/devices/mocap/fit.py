"""Calibration from two places: level on the floor, then again after a straight move nose first.

At both places the vehicle is level, so its attitude is a heading alone; the way between them is the
direction of its nose. The height above the floor gives the pivot's height; its horizontal place is
not observable from these, and is stated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uam_control.maths.rotations import (
    euler_from_quaternion,
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_multiply,
    rotate,
    wrap_angle,
)
from uam_sim_bridge.devices.mocap.calibration import Calibration, conjugate, world_rotation
from uam_sim_bridge.devices.mocap.frame import BodyPose, MocapError
from uam_sim_bridge.devices.mocap.measurement import StillPose

SHORTEST = 0.5  # [m] between the places: 5 mm sideways are then 0.6 deg
STEEPEST = 0.02  # [m] difference of the heights
TILT = math.radians(1.0)  # between the places: an uneven floor, or not level
DEFINED_TILT = math.radians(15.0)  # of the rigid body's axes against the tracker's
TURN = math.radians(3.0)  # between the places: not moved straight
LOWEST, HIGHEST = -0.1, 0.5  # [m] of the pivot from base_link, upwards


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
