"""Position of the magnet's face from the state, for an arm that turns about the body's y axis."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uam_control.coordinates import ALPHA, POSITION, ROLL, Z
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import matrix_from_euler


def magnet_and_lever(
    chi: np.ndarray, mount: Sequence[float], links: Sequence[float], magnet: float
) -> tuple[np.ndarray, float]:
    """Return the centre of the magnet's face (3,) [m, world], and the distance [m] of the magnet's
    pivot from the first joint along the body's x axis.

    chi (6 + n,): generalised coordinates; mount (3,) [m, FLU]: first joint; links (n,) [m]: the
    last one to the magnet's pivot; magnet [m]: pivot to face. The magnet hangs vertically.
    """
    point = np.empty(3)
    along = below_joint(chi, np.asarray(mount, dtype=float), np.asarray(links, dtype=float), point)
    pivot = chi[POSITION] + matrix_from_euler(chi[ROLL:ALPHA]) @ point
    pivot[Z] -= magnet
    return pivot, along


@jit
def below_joint(chi: np.ndarray, mount: np.ndarray, links: np.ndarray, point: np.ndarray) -> float:
    """Write the magnet's pivot in the base frame (3,) [m, FLU]; return its distance from the first
    joint along x [m].

    chi (6 + n,), mount (3,), links (n,): see `magnet_and_lever`.
    """
    angle = along = above = 0.0
    for i in range(len(links)):
        angle += chi[ALPHA + i]
        along += links[i] * math.sin(angle)
        above += links[i] * math.cos(angle)
    point[0], point[1], point[2] = mount[0] + along, mount[1], mount[2] - above
    return along
