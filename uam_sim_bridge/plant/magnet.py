"""The electromagnet: finite holding force that decreases with the air gap.

MuJoCo's adhesion actuator pulls along the normals of the contacts between magnet and payload;
contact and friction decide whether the payload is held. This module sets only the strength.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from uam_control.maths.compiled import jit


def magnet_constants(model: mujoco.MjModel, gap_scale: float) -> np.ndarray:
    """Return the constants (4,) of `pull_fraction`: height, reach, thickness, gap_scale, all [m].

    The first three describe the steel plate in the payload's frame: height of its upper side,
    largest horizontal distance at which the magnet's face still overlaps it, and thickness.
    """
    plate, face = model.geom("payload_plate").size, model.geom("magnet_face").size
    return np.array([model.geom("payload").size[2], plate[0] + face[0], 2 * plate[2], gap_scale])


@jit
def pull_fraction(
    face: np.ndarray, payload: np.ndarray, payload_axes: np.ndarray, constants: np.ndarray
) -> float:
    """Return the fraction 0..1 of the holding force at the present air gap to the steel plate.

    face (3,) [m, world]: centre of the magnet's face; payload (3,) [m, world], payload_axes (9,):
    centre and rotation matrix (payload → world, row by row) of the payload; constants (4,): of
    `magnet_constants`. Reluctance of an air gap: F = F0 / (1 + gap / gap_scale)^2.
    """
    height, reach, thickness, gap_scale = constants
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
    ratio = 1.0 + math.sqrt(gap_squared) / gap_scale
    return 1.0 / (ratio * ratio)
