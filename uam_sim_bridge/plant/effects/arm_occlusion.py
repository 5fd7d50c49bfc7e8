"""Occlusion of the markers by arm and payload.

A marker sits on each rotor's mount and one on the top deck. Cameras stand on a ring around the
room, high and low in turn. A camera does not see a marker if the line between them passes through
the arm (capsules between the joints and its tip) or the payload (a sphere at the tip). A
marker needs two cameras, a pose three markers. Every marker has a calibration error, constant in a
flight: the pose jumps when the set of seen markers changes, by the mean of the errors.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.memory import put
from uam_control.maths.rotations import quaternion_from_rotation_vector, quaternion_multiply
from uam_sim_bridge.plant.arm_geometry import tip_of
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size
from uam_sim_bridge.plant.vehicle import PAYLOAD

DECK = (0.0, 0.0, 0.08)  # [m, FLU] marker on the top deck
FEWEST_CAMERAS, FEWEST_MARKERS = 2, 3
AT_THE_TIP = 0.1  # [m] distance up to which the payload covers markers


class ArmOcclusion(Effect):
    """Arm and payload hide markers from cameras: the pose jumps a little, or is lost."""

    SOURCE = (
        "geometry; two cameras per marker and three markers per rigid body: OptiTrack, Motive; "
        "cameras and calibration error: assumptions (8 cameras on a ring of 4 m)"
    )

    cameras: float = size("number of cameras", "1", 2.0, 64.0)
    ring: float = size("radius of the cameras' ring", "m", 0.5, 50.0)
    high: float = size("height of every other camera", "m", 0.0, 20.0)
    low: float = size("height of the others", "m", 0.0, 20.0)
    thickness: float = size("radius of arm and payload", "m", 0.0, 0.2)
    marker_error: float = size("standard deviation of a marker's calibration", "m", 0.0, 0.01)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        angles = 2.0 * math.pi * np.arange(int(self.cameras)) / int(self.cameras)
        heights = np.where(np.arange(int(self.cameras)) % 2, self.low, self.high)
        cameras = np.column_stack([self.ring * np.cos(angles), self.ring * np.sin(angles), heights])
        markers = np.vstack([bench.positions, DECK])
        errors = self.marker_error * noise.standard_normal(markers.shape)
        model, data = bench.model, bench.data
        chain = model.jnt_bodyid[model.dof_jntid[bench.arm]].astype(np.int64)
        payload = data.xpos[model.body(PAYLOAD).id]
        arrays = OcclusionArrays(
            *(bench.pose, bench.memory, bench.base_position, bench.base_axes),
            *(markers, cameras, errors - errors.mean(axis=0)),
            *(data.xpos, chain, tip_of(model, data, chain[-1]), payload),
            *(np.zeros((len(chain) + 2, 3)), np.zeros(len(markers), dtype=np.bool_)),
            self.thickness,
        )
        return Compiled(arrays, pose=hide)


@jit
def seen_markers(
    base: np.ndarray,
    axes: np.ndarray,
    markers: np.ndarray,
    cameras: np.ndarray,
    chain: np.ndarray,
    thickness: float,
    seen: np.ndarray,
) -> int:
    """Return the number of markers that enough cameras see; write them to seen (markers,).

    base (3,) [m, ENU]; axes (9,): body → world, row by row; markers (markers, 3) [m, FLU]; cameras
    (cameras, 3) [m, ENU]; chain (points, 3) [m, ENU]: of the arm, base to tip; thickness [m].
    """
    total = 0
    marker = np.empty(3)
    for i in range(len(markers)):
        for k in range(3):
            marker[k] = base[k]
            for m in range(3):
                marker[k] += axes[3 * k + m] * markers[i, m]
        count = 0
        for j in range(len(cameras)):
            free = True
            for link in range(len(chain) - 1):
                if distance(marker, cameras[j], chain[link], chain[link + 1]) < thickness:
                    free = False
                    break
            count += free
        seen[i] = count >= FEWEST_CAMERAS
        total += seen[i]
    return total


@borrowing
def distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Return the distance [m] of the segments a-b and c-d, all points (3,) [m]."""
    uu, vv, uv, uw, vw = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        u, v, w = b[k] - a[k], d[k] - c[k], a[k] - c[k]
        uu, vv, uv, uw, vw = uu + u * u, vv + v * v, uv + u * v, uw + u * w, vw + v * w
    det = uu * vv - uv * uv
    s = min(1.0, max(0.0, (uv * vw - vv * uw) / det)) if det > 1e-12 * uu * vv else 0.0
    t = (uv * s + vw) / vv if vv > 0.0 else 0.0
    if t < 0.0 or t > 1.0:
        t = min(1.0, max(0.0, t))
        s = min(1.0, max(0.0, (uv * t - uw) / uu)) if uu > 0.0 else 0.0
    squared = 0.0
    for k in range(3):
        gap = a[k] + s * (b[k] - a[k]) - c[k] - t * (d[k] - c[k])
        squared += gap * gap
    return math.sqrt(squared)


class OcclusionArrays(NamedTuple):
    """What the occlusion uses. Fields without a comment: see `seen_markers`."""

    pose: np.ndarray  # of `Bench`
    status: np.ndarray  # (1,) of `Bench`
    base: np.ndarray
    axes: np.ndarray
    markers: np.ndarray
    cameras: np.ndarray
    errors: np.ndarray  # (markers, 3) [m, FLU] of the markers
    bodies: np.ndarray  # xpos of MuJoCo
    chain: np.ndarray  # the arm's, base to tip
    tip: np.ndarray  # (3,) [m, ENU]
    payload: np.ndarray  # (3,) [m, ENU]
    points: np.ndarray  # for the arm and a held payload
    seen: np.ndarray
    thickness: float


@borrowing
def hide(a: OcclusionArrays) -> int:
    """Shift the newest pose by the errors of the markers that are seen; lose it with too few."""
    n = len(a.chain)
    for i in range(n):
        put(a.bodies[a.chain[i]], a.points[i])
    put(a.tip, a.points[n])
    gap = 0.0
    for k in range(3):
        gap += (a.payload[k] - a.tip[k]) ** 2
    held = gap < AT_THE_TIP * AT_THE_TIP
    put(a.payload if held else a.tip, a.points[n + 1])
    count = seen_markers(a.base, a.axes, a.markers, a.cameras, a.points, a.thickness, a.seen)
    if count < FEWEST_MARKERS:
        a.status[0].lost = 1
    elif count < len(a.seen):
        shift_pose(a.pose, a.axes, a.markers, a.errors, a.seen)
    return 0


@jit
def shift_pose(
    pose: np.ndarray, axes: np.ndarray, markers: np.ndarray, errors: np.ndarray, seen: np.ndarray
) -> None:
    """Move a pose (POSE,) as the mean errors of the seen markers do; arguments of `hide`."""
    share = 1.0 / np.sum(seen)
    middle, shift, moment, spread = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    for i in range(len(seen)):
        if seen[i]:
            middle += share * markers[i]
            shift += share * errors[i]
    for i in range(len(seen)):
        if seen[i]:
            arm = markers[i] - middle
            moment += np.cross(arm, errors[i] - shift)
            spread += np.sum(arm * arm)
    for i in range(3):
        for k in range(3):
            pose[1 + i] += axes[3 * i + k] * shift[k]
    turn = quaternion_from_rotation_vector(moment / spread)
    pose[4:] = quaternion_multiply(pose[4:], turn)
