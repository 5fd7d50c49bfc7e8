"""Position of the magnet's face from the state, for an arm that turns about the body's y axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uam_control.coordinates import ALPHA, POSITION, ROLL
from uam_control.maths.rotations import matrix_from_euler


def magnet_position(
    chi: np.ndarray, mount: Sequence[float], links: Sequence[float], magnet: float
) -> np.ndarray:
    """Return the centre of the magnet's face (3,) [m, world].

    chi (6 + n,): generalised coordinates; mount (3,) [m, FLU]: first joint; links (n,) [m]: the
    last one to the magnet's pivot; magnet [m]: pivot to face. The magnet hangs vertically.
    """
    angles = np.cumsum(chi[ALPHA:])
    lengths = np.asarray(links)
    arm = np.array([np.sum(lengths * np.sin(angles)), 0.0, -np.sum(lengths * np.cos(angles))])
    pivot = chi[POSITION] + matrix_from_euler(chi[ROLL:ALPHA]) @ (np.asarray(mount) + arm)
    return pivot - np.array([0.0, 0.0, magnet])


def lever(chi: np.ndarray, links: Sequence[float]) -> float:
    """Return the distance [m] of the magnet's pivot from the first joint along the body's x axis.

    chi (6 + n,): generalised coordinates; links (n,) [m].
    """
    return float(np.sum(np.asarray(links) * np.sin(np.cumsum(chi[ALPHA:]))))
