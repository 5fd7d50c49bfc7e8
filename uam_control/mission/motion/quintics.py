"""Quintic polynomials between two points of a motion, and their derivatives."""

from __future__ import annotations

import numpy as np

from uam_control.coordinates import CHI, CHI_DDOT, CHI_DOT


def quintic(start: np.ndarray, goal: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return coefficients (6, ..., k) of quintics in u = 0..1.

    start, goal (3 or more, ..., k): value, rate and acceleration at u = 0 and 1; lengths [s]:
    durations, of a shape that broadcasts to (..., k).
    """
    p, v, a = start[CHI], start[CHI_DOT] * lengths, start[CHI_DDOT] * lengths**2  # per length
    v1, a1 = goal[CHI_DOT] * lengths, goal[CHI_DDOT] * lengths**2
    d = goal[CHI] - p
    return np.array([
        p, v, a / 2,
        10 * d - 6 * v - 1.5 * a - 4 * v1 + 0.5 * a1,
        -15 * d + 8 * v + 1.5 * a + 7 * v1 - a1,
        6 * d - 3 * v - 0.5 * a - 3 * v1 + 0.5 * a1,
    ])  # fmt: skip


def quintic_at(c: np.ndarray, u: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return value, rate, acceleration, jerk and snap (5, ...) of quintics at u.

    c (6, ..., k): coefficients; u, lengths [s]: of shapes that broadcast to (..., k).
    """
    rate = c[1] + u * (2 * c[2] + u * (3 * c[3] + u * (4 * c[4] + u * 5 * c[5])))
    second = 2 * c[2] + u * (6 * c[3] + u * (12 * c[4] + u * 20 * c[5]))
    third = 6 * c[3] + u * (24 * c[4] + u * 60 * c[5])
    fourth = 24 * c[4] + u * 120 * c[5]
    value = c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * (c[4] + u * c[5]))))
    return np.array(
        [value, rate / lengths, second / lengths**2, third / lengths**3, fourth / lengths**4]
    )
