"""Joint angles for a place of the end effector, and the places that an arm reaches."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from uam_control.arm.chain import Chain
from uam_control.arm.kinematics import DOWN, hand_jacobian, hand_pose

STARTS = 24  # of the search, a fixed set
INSIDE = 1e-9  # of a range, in which a search begins


def angles_for(
    chain: Chain, position: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the angles (n,) [rad] within low, high (n,) that bring the hand nearest, and how near.

    position (3,) [m]: in the frame of a level base; the distance [m] is 0 where the arm reaches it.
    """

    def miss(angles: np.ndarray) -> np.ndarray:
        return np.array(hand_pose(chain, angles, DOWN)[0]) - position

    def slopes(angles: np.ndarray) -> np.ndarray:
        jacobian = np.empty((6, len(angles)))
        hand_jacobian(chain, angles, DOWN, jacobian)
        return jacobian[:3]

    best, least = 0.5 * (low + high), np.inf
    shares = np.random.default_rng(0).uniform(INSIDE, 1.0 - INSIDE, (STARTS, len(low)))
    for start in low + shares * (high - low):
        found = least_squares(miss, start, slopes, (low, high), xtol=1e-14, ftol=1e-14, gtol=1e-14)
        distance = float(np.linalg.norm(found.fun))
        if distance < least - 1e-9:
            best, least = found.x, distance
    return best, least


def reached(chain: Chain, low: np.ndarray, high: np.ndarray, count: int) -> np.ndarray:
    """Return places (count, 3) [m] of the hand of a level base, angles uniform within low, high."""
    postures = np.random.default_rng(0).uniform(low, high, (count, len(low)))
    return np.array([hand_pose(chain, one, DOWN)[0] for one in postures])
