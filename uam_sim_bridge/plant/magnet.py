"""The gripper: finite holding force that decreases with the gap, an electromagnet's or any other's.

MuJoCo's adhesion actuator pulls along the normals of the contacts between magnet and payload;
contact and friction decide whether the payload is held. This module sets only the strength.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from uam_control.maths.compiled import borrowing

LAW = 4  # constants of the magnet's law
NO_MAGNET = np.ones(LAW)  # its force is 0: nothing has its control


def magnet_constants(
    model: mujoco.MjModel, gap_scale: float, curve: Sequence[Sequence[float]] = ()
) -> np.ndarray:
    """Return the constants (4 + 2 k,) of `pull_fraction`: height, reach, thickness, gap_scale, all
    [m], then the curve.

    The first three describe the plate in the payload's frame: height of its upper side, largest
    horizontal distance at which the gripper's face still overlaps it, and thickness. curve: k
    points [gap [m], fraction of the holding force], by gap; without it the magnet's law.
    """
    plate, face = model.geom("payload_plate").size, model.geom("magnet_face").size
    whole = model.geom("payload").size[2], plate[0] + face[0], 2 * plate[2], gap_scale
    return np.array([*whole, *np.ravel(curve)])


@borrowing
def pull_fraction(
    face: np.ndarray, payload: np.ndarray, payload_axes: np.ndarray, constants: np.ndarray
) -> float:
    """Return the fraction 0..1 of the holding force at the present gap to the payload's plate.

    face (3,) [m, world]: centre of the gripper's face; payload (3,) [m, world], payload_axes (9,):
    centre and rotation matrix (payload → world, row by row) of the payload; constants: of
    `magnet_constants`. Reluctance of an air gap: F = F0 / (1 + gap / gap_scale)^2; a curve is
    followed in straight lines, and is constant beyond its ends.
    """
    height, reach, thickness, gap_scale = constants[0], constants[1], constants[2], constants[3]
    gap_squared = 0.0
    for axis in range(3):
        along = 0.0
        for i in range(3):
            along += (face[i] - payload[i]) * payload_axes[3 * i + axis]
        if axis < 2:
            gap = max(abs(along) - reach, 0.0)
        else:
            gap = max(along - height, height - thickness - along, 0.0)
        gap_squared += gap * gap
    gap = math.sqrt(gap_squared)
    if len(constants) > LAW:
        return on_curve(gap, constants)
    ratio = 1.0 + gap / gap_scale
    return 1.0 / (ratio * ratio)


@borrowing
def on_curve(gap: float, constants: np.ndarray) -> float:
    """Return the fraction at a gap [m] on the curve in the constants of `magnet_constants`."""
    last = len(constants) - 2
    for i in range(LAW, last, 2):
        before, after = constants[i], constants[i + 2]
        if gap < after:
            share = max(0.0, (gap - before) / (after - before))
            return constants[i + 1] + share * (constants[i + 3] - constants[i + 1])
    return constants[last + 1]
