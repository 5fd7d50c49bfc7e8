"""Mean pose of a body that stands still, and the refusal of one that does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uam_sim_bridge.devices.mocap.frame import BodyPose, MocapError

FEWEST = 60  # poses, half a second at 120 Hz
# A tracker has some 0.4 mm and 0.1 deg of noise; a vehicle that is held by hand moves more.
MOVED = 0.003  # [m]
TURNED = math.radians(0.5)


class TimedPose(NamedTuple):
    """A pose of the tracker at `time` [s]."""

    time: float
    pose: BodyPose


class StillPose(NamedTuple):
    """position (3,) [m] and quaternion (4,) [w x y z], tracker's axes: means of `count` poses.

    spread [m], wobble [rad]: root mean square of the distances from the means.
    """

    position: np.ndarray
    quaternion: np.ndarray
    spread: float
    wobble: float
    count: int


def still(poses: Sequence[TimedPose], what: str) -> StillPose:
    """Return the mean pose; raise MocapError if there are too few poses or the body moved.

    what: the place, for messages. Slow motion counts, too: the halves are compared.
    """
    if len(poses) < FEWEST:
        raise MocapError(f"{what}: {len(poses)} poses, at least {FEWEST} are needed")
    mean = _mean(poses)
    half = len(poses) // 2
    first, second = _mean(poses[:half]), _mean(poses[half:])
    moved = max(mean.spread, float(np.linalg.norm(second.position - first.position)))
    turned = max(mean.wobble, angle_between(first.quaternion, second.quaternion))
    if moved > MOVED or turned > TURNED:
        raise MocapError(
            f"{what}: the vehicle moved during the measurement, {1e3 * moved:.1f} mm and "
            f"{math.degrees(turned):.2f} deg; allowed: {1e3 * MOVED:.1f} mm and "
            f"{math.degrees(TURNED):.2f} deg"
        )
    return mean


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle [rad] between two unit quaternions (4,)."""
    return 2.0 * math.acos(min(1.0, abs(float(a @ b))))


def places(poses: Sequence[TimedPose], duration: float) -> list[Sequence[TimedPose]]:
    """Return the stretches of a recording, of `duration` [s] at least, in which the body is still.

    A pose belongs to a stretch while it is closer than 2 MOVED and 2 TURNED to the stretch's
    first pose. The ends of a stretch, where the body was set down or lifted, are left out.
    """
    found, begin = [], 0
    for i in range(1, len(poses) + 1):
        if i < len(poses) and _close(poses[begin].pose, poses[i].pose):
            continue
        if poses[i - 1].time - poses[begin].time >= duration:
            tenth = (i - begin) // 10
            found.append(poses[begin + tenth : i - tenth])
        begin = i
    return found


def _close(a: BodyPose, b: BodyPose) -> bool:
    near = float(np.linalg.norm(b.position - a.position)) < 2.0 * MOVED
    return near and angle_between(a.quaternion, b.quaternion) < 2.0 * TURNED


def _mean(poses: Sequence[TimedPose]) -> StillPose:
    """The mean quaternion is the largest eigenvector of the sum of q qᵀ (Markley 2007)."""
    positions = np.array([one.pose.position for one in poses])
    quaternions = np.array([one.pose.quaternion for one in poses])
    quaternion = np.linalg.eigh(quaternions.T @ quaternions)[1][:, -1]
    position = positions.mean(axis=0)
    spread = math.sqrt(float(np.mean(np.sum((positions - position) ** 2, axis=1))))
    angles = [angle_between(quaternion, one) for one in quaternions]
    wobble = math.sqrt(float(np.mean(np.square(angles))))
    return StillPose(position, quaternion, spread, wobble, len(poses))
