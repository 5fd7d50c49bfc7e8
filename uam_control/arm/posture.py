"""A posture in which an arm works well: bent, away from the ends of its joints."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.hand import freedom, hinge_angles, stretch

STEP = math.radians(5.0)  # of the search
GAIN = 1e-3  # relative, by which another posture must be better; less does not count


def working_posture(
    chain: Chain,
    stowed: Sequence[float],
    low: np.ndarray,
    high: np.ndarray,
    hinge: tuple[float, float] = (-math.inf, math.inf),
) -> np.ndarray:
    """Return the angles (n,) [rad] within low, high (n,) in which the hand moves best.

    hinge: range [rad] of the hinge that the hand hangs on.

    That is the largest product of the singular values of its Jacobian (Yoshikawa's
    manipulability), found joint by joint from `stowed` on.
    """
    angles = np.clip(np.asarray(stowed, dtype=float), low, high)
    counted = freedom(chain)
    best = _manipulability(chain, angles, counted, hinge)
    improved = True
    while improved:
        improved = False
        for joint in range(len(angles)):
            steps = np.arange(
                math.ceil((low[joint] - angles[joint]) / STEP),
                math.floor((high[joint] - angles[joint]) / STEP) + 1,
            )
            tried = np.repeat(angles[None], len(steps), axis=0)
            tried[:, joint] += STEP * steps
            found = [_manipulability(chain, one, counted, hinge) for one in tried]
            if found and max(found) > best + GAIN * abs(best):
                good = np.flatnonzero(np.array(found) > max(found) - GAIN * abs(max(found)))
                nearest = good[np.argmin(np.abs(steps[good]))]
                best, angles = found[nearest], tried[nearest]
                improved = True
    return angles


def _manipulability(
    chain: Chain, angles: np.ndarray, counted: int, hinge: tuple[float, float]
) -> float:
    """Return the product of the singular values, below 0 where the hinge is beyond its range."""
    stands = float(hinge_angles(chain, angles[None])[0])
    if stands < hinge[0] or stands > hinge[1]:
        return -max(hinge[0] - stands, stands - hinge[1])
    return float(np.prod(stretch(chain, angles)[:counted]))
