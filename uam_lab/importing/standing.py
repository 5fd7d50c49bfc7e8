"""How the vehicle stands: ranges of the joints, the stowed arm, and the feet."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uam_lab.importing import geometry
from uam_lab.importing.answers import ASSUMED, DERIVED, FILE, Answers, Told
from uam_lab.importing.structure import Parts
from uam_sim_bridge.plant.arm_geometry import outline

DEGREES = 4.0 * math.pi, 720.0  # [rad] a limit in between is one in degrees
LEAST = 0.2  # [rad] smallest range of a joint, see `loading.LEAST_RANGE`
FOOT = 0.012  # [m] radius of a foot: class foot of parts/world.xml
LOW = 0.015  # [m] above the lowest point: a shape of the base there is one to stand on
FACE = 0.045  # [m] from the magnet's pivot to the edge of its face
NARROWEST = 0.06  # [m] half distance of feet
STEPS_DEG = (0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 120.0, -120.0, 150.0, -150.0)
MOST_POSES = 3000


@dataclass
class Stance:
    """How a vehicle stands."""

    ranges: list[Told]  # [deg]
    stowed: list[Told]  # [deg]
    feet: np.ndarray  # (4, 3) [m] in the base's frame
    legs: Told  # whether they are added
    height: float  # [m] of the base


def stand(parts: Parts, answers: Answers, usual: Sequence[float] | None = None) -> Stance:
    """Return how the vehicle stands; the model is left with all joints at zero.

    usual: how the arm is stowed (n,) [rad] on another vehicle, whose scenarios it shall fly.
    """
    zeros, ranges = np.zeros(len(parts.joints)), _ranges(parts, answers)
    geometry.set_angles(parts, zeros)
    feet, low = _feet(parts)
    clearance = answers.assumed.number("clearance")
    if usual is None:
        angles, bottom = _stow(parts, ranges, low, clearance)
    else:
        angles = np.array(usual)
        geometry.set_angles(parts, angles)
        bottom = _bottom(parts, _boxes(parts))
    legs = Told(False, FILE, "lowest shapes of the base")
    gap = bottom - low
    if feet is None or gap < clearance:
        low = min(low, bottom - clearance)
        feet = _added_feet(parts, answers, low)
        why = "the base has no wide feet" if gap >= clearance else "the arm reaches below the base"
        legs = Told(True, ASSUMED, why)
    feet[:, 2] = low + FOOT
    why = f"the arm is {1e3 * (bottom - low):.0f} mm above the feet"
    stowed = [Told(round(math.degrees(a), 1), DERIVED, why) for a in angles]
    geometry.set_angles(parts, zeros)
    return Stance(ranges, stowed, feet, legs, 0.005 - low)


def _ranges(parts: Parts, answers: Answers) -> list[Told]:
    """Return the ranges [deg] of the joints, at most half a turn to either side."""
    model, ranges = parts.model, []
    endless = math.radians(answers.assumed.number("endless_joint"))
    for joint in parts.joints:
        limited = bool(model.jnt_limited[joint])
        given = model.jnt_range[joint] if limited else (-endless, endless)
        if DEGREES[0] < (largest := float(np.abs(given).max())) <= DEGREES[1]:
            text = f"its limit of {largest:g} rad is over two turns: in degrees? rad are expected"
            raise parts.source.error("joint", model.joint(joint).name, text)
        low, high = np.clip(given, -math.pi, math.pi)
        if high - low < LEAST:
            text = f"its range of {high - low:.3g} rad is below {LEAST:g} rad"
            raise parts.source.error("joint", model.joint(joint).name, text)
        origin = (FILE, "") if limited else (ASSUMED, "the file has no limits")
        rounded = [math.trunc(100.0 * math.degrees(one)) / 100.0 for one in (low, high)]  # inwards
        ranges.append(Told(rounded, *origin))
    return ranges


def _in_base(parts: Parts, points: np.ndarray) -> np.ndarray:
    origin, axes = parts.frame(0)
    return (points - origin) @ axes


def _feet(parts: Parts) -> tuple[np.ndarray | None, float]:
    """Return the feet (4, 3) [m] below the base's lowest shapes, None if it cannot stand on them,
    and the height [m] of its lowest point."""
    geoms = geometry.shapes(parts, 0, True) or geometry.shapes(parts, 0, False)
    if not geoms:
        return None, 0.0
    points = np.vstack([_in_base(parts, outline(parts.model, parts.data, g)) for g in geoms])
    low = float(points[:, 2].min())
    on_ground = points[points[:, 2] < low + LOW]
    first, last = on_ground.min(axis=0)[:2], on_ground.max(axis=0)[:2]
    centre = _in_base(parts, parts.data.subtree_com[parts.base][None])[0, :2]
    inside = np.all(centre > first + NARROWEST / 2) and np.all(centre < last - NARROWEST / 2)
    if not inside or np.any(last - first < 2.0 * NARROWEST):
        return None, low
    return _corners(first, last, low), low


def _corners(first: np.ndarray, last: np.ndarray, low: float) -> np.ndarray:
    return np.array([[x, y, low] for x, y in itertools.product(*zip(first, last, strict=True))])


def _added_feet(parts: Parts, answers: Answers, low: float) -> np.ndarray:
    """Return feet (4, 3) [m] of a landing gear that is added around the centre of mass."""
    centre = _in_base(parts, parts.data.subtree_com[parts.base][None])[0, :2]
    apart = [np.linalg.norm(rotor.position[:2]) for rotor in parts.rotors] or [2.0 * NARROWEST]
    half = max(NARROWEST, answers.assumed.number("clear_rotors") * float(np.mean(apart)))
    return _corners(centre - half, centre + half, low)


def _stow(
    parts: Parts, ranges: list[Told], low: float, clearance: float
) -> tuple[np.ndarray, float]:
    """Return the joint angles (n,) [rad] in which the arm stays above the feet with little motion
    from zero, and its magnet hangs down freely, and the arm's lowest point [m] there; without such,
    those of the highest arm."""
    choices = []
    for low_deg, high_deg in (one.value for one in ranges):
        inside = [a for a in STEPS_DEG if low_deg + 5.0 <= a <= high_deg - 5.0]
        choices.append(np.radians(inside or [0.5 * (low_deg + high_deg)]))
    poses = list(itertools.islice(itertools.product(*choices), 200_000))
    poses.sort(key=lambda pose: sum(map(abs, pose)))
    if len(poses) > MOST_POSES:
        poses = poses[:MOST_POSES]
    boxes = _boxes(parts)
    best, highest = np.zeros(len(ranges)), -math.inf
    for pose in poses:
        geometry.set_angles(parts, np.array(pose))
        if not geometry.hangs(parts):
            continue
        bottom = _bottom(parts, boxes)
        if bottom - low >= clearance:
            return np.array(pose), bottom
        if bottom > highest + 0.005:
            best, highest = np.array(pose), bottom
    if math.isinf(highest):
        text = "its magnet can hang straight down in no pose of the arm: --no-magnet"
        raise parts.source.error("joint", parts.model.joint(parts.joints[-1]).name, text)
    geometry.set_angles(parts, best)
    return best, highest


def _boxes(parts: Parts) -> list[tuple[int, np.ndarray]]:
    """Return the corners (m, 3) [m] of the arm's shapes in the frame of their body."""
    found = []
    for link in range(1, len(parts.joints) + 1):
        geoms = geometry.shapes(parts, link, True) or geometry.shapes(parts, link, False)
        for geom in geoms:
            body = int(parts.model.geom_bodyid[geom])
            points = outline(parts.model, parts.data, geom, exact=False) - parts.data.xpos[body]
            found.append((body, points @ parts.data.xmat[body].reshape(3, 3)))
    return found


def _bottom(parts: Parts, boxes: list[tuple[int, np.ndarray]]) -> float:
    """Return the height [m] of the arm's lowest point in the base's frame, magnet included; of a
    link without shapes its joint."""
    data, (origin, axes) = parts.data, parts.frame(0)
    place, last = geometry.tip(parts)[0], parts.frame(len(parts.joints))
    heights = [float((last[0] + last[1] @ place - origin) @ axes[:, 2]) - FACE]
    heights += _in_base(parts, data.xanchor[list(parts.joints)])[:, 2].tolist()
    for body, points in boxes:
        turned = points @ data.xmat[body].reshape(3, 3).T + data.xpos[body] - origin
        heights.append(float((turned @ axes[:, 2]).min()))
    return min(heights)
