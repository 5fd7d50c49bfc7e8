"""The electromagnet: finite holding force, falling off with the air gap.

MuJoCo's adhesion actuator pulls along the normals of the contacts between magnet and payload; what
it holds, and whether, comes out of contact and friction. Here only its strength is set.
"""

from __future__ import annotations

import numpy as np

from uam_control.compiled import jit


@jit
def pull_fraction(
    face: np.ndarray,
    payload: np.ndarray,
    payload_axes: np.ndarray,
    half_height: float,
    gap_scale: float,
) -> float:
    """Return the fraction 0..1 of the holding force at the present air gap.

    face (3,): centre of the magnet's face; payload (3,), payload_axes (9,): centre and rotation
    matrix, row by row, of the payload; half_height [m]: from its centre to its steel plate;
    gap_scale [m]. Reluctance of an air gap: F = F0 / (1 + gap / gap_scale)^2.
    """
    above = 0.0
    for i in range(3):
        above += (face[i] - payload[i]) * payload_axes[3 * i + 2]
    ratio = 1.0 + max(above - half_height, 0.0) / gap_scale
    return 1.0 / (ratio * ratio)
