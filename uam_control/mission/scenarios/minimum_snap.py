"""Minimum-snap references through waypoints: from rest, through every point, to rest.

For given times the curve of least integral of the squared snap consists of polynomials of degree 7,
with derivatives up to the sixth continuous at the inner points (Mellinger and Kumar 2011). These
are as many linear equations as unknowns.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.mission.motion.polynomials import Polynomials

ORDER = 8  # coefficients of a polynomial
CONTINUOUS = range(1, ORDER - 1)  # derivatives that are continuous at an inner point
END_SHARE = 2.0  # the mean speed from rest is half of the speed reached
AT_REST = range(1, ORDER // 2)  # derivatives that are zero at both ends


def minimum_snap(times: np.ndarray, points: np.ndarray) -> Polynomials:
    """Return the curve through points (m, n) at times (m,) [s], increasing, m at least 2."""
    widths, count = np.diff(times), len(times) - 1
    begin, end = _derivatives(0.0), _derivatives(1.0)
    matrix = np.zeros((ORDER * count, ORDER * count))
    right = np.zeros((ORDER * count, points.shape[1]))
    row = 0

    def equation(terms: list[tuple[int, np.ndarray]], value: np.ndarray | float = 0.0) -> None:
        nonlocal row
        for piece, weights in terms:
            matrix[row, ORDER * piece : ORDER * (piece + 1)] += weights
        right[row] = value
        row += 1

    for k in range(count):
        equation([(k, begin[0])], points[k])
        equation([(k, end[0])], points[k + 1])
    for k in range(count - 1):
        ratio = widths[k] / widths[k + 1]
        for r in CONTINUOUS:  # scaled by the width of the first of the two
            equation([(k, end[r]), (k + 1, -begin[r] * ratio**r)])
    for r in AT_REST:
        equation([(0, begin[r])])
        equation([(count - 1, end[r])])
    powers = np.linalg.solve(matrix, right)
    return Polynomials(times, powers.reshape(count, ORDER, -1))


def _derivatives(u: float) -> np.ndarray:
    """Return derivative r of u^j, (ORDER, ORDER)."""
    return np.array(
        [
            [math.perm(j, r) * u ** (j - r) if j >= r else 0.0 for j in range(ORDER)]
            for r in range(ORDER)
        ]
    )


def shares(points: np.ndarray) -> np.ndarray:
    """Return times (m,) from 0 to 1 for points (m, 3) [m]: in proportion to the distances' roots.

    So each piece needs about the same acceleration. In proportion to the distances themselves the
    curve swings far out between points that are not equally far apart. The first and the last piece
    have END_SHARE times as much.
    """
    widths = np.sqrt(np.linalg.norm(np.diff(points, axis=0), axis=1))
    widths[[0, -1]] *= END_SHARE
    return np.append(0.0, np.cumsum(widths)) / widths.sum()
