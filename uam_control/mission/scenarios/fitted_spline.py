"""Smooth interpolation of samples: a spline of degree 7, with six continuous derivatives.

The spline is the least-squares fit to values and, where they are given, rates and accelerations.
The knots lie close enough that it passes every value within a tolerance. A planner's file has
rounded numbers, and rates and accelerations that belong only approximately to its positions; an
interpolation through all of them (quintic Hermite) has jumps in the jerk. This one has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uam_control.mission.motion.polynomials import Polynomials

if TYPE_CHECKING:
    from scipy.interpolate import BSpline
    from scipy.sparse import csc_matrix, csr_matrix

# scipy is imported where it is used: that takes most of a second, and few processes read a file

DEGREE = 7
COARSEST = 0.2  # [s] distance of the knots in the first attempt, or that of the samples
LONG_GAP = 2.0  # [s] between two samples: the normal equations lose the curve in longer ones
ATTEMPTS = 5  # each with knots at half the distance
# A unit of misfit in rate, acceleration and snap weighs as much as these in value [s, s^2, s^4].
RATE, ACCELERATION, SNAP = 1e-2, 1e-3, 5e-9
END, END_PIECES = 3e-7, 2  # [s^6] of the sixth derivative in so many intervals at either end
DENSE = 1.5  # rows per interval, from which on
LEAST_ACCELERATION = 1e-6  # [s^2] of acceleration itself: decides where under four samples do not


class Misfit(ValueError):
    """No spline passes the samples: number of the worst group and row, and its distance."""

    def __init__(self, group: int, row: int, distance: float) -> None:
        super().__init__(f"{distance:.3g} at row {row}")
        self.group, self.row, self.distance = group, row, distance


class CurveSamples(NamedTuple):
    """Values (m, n) at m times; rates, accelerations (m, n): None if not given."""

    values: np.ndarray
    rates: np.ndarray | None = None
    accelerations: np.ndarray | None = None


def fitted(
    times: np.ndarray,
    groups: Sequence[CurveSamples],
    tolerance: float,
    coarsest: float = COARSEST,
) -> list[Polynomials]:
    """Return a spline per group through its values, all with the same knots.

    times (m,) [s], increasing; tolerance: of every value; coarsest [s]: largest distance of the
    knots. Raises Misfit.
    """
    span = float(times[-1] - times[0])
    step = max(coarsest, span / (len(times) - 1))
    for _ in range(ATTEMPTS):
        knots = _knots(times, max(1, round(span / step)))
        found = [_solved(times, group, knots) for group in groups]
        apart = np.array(
            [
                np.abs(spline(times) - group.values).max(axis=1)
                for spline, group in zip(found, groups, strict=True)
            ]
        )
        if apart.max() <= tolerance:
            return [_polynomials(spline) for spline in found]
        step /= 2.0
    worst, row = np.unravel_index(np.argmax(apart), apart.shape)
    raise Misfit(int(worst), int(row), float(apart.max()))


def _knots(times: np.ndarray, intervals: int) -> np.ndarray:
    inner = np.linspace(times[0], times[-1], intervals + 1)
    return np.concatenate([[times[0]] * DEGREE, inner, [times[-1]] * DEGREE])


def _solved(times: np.ndarray, given: CurveSamples, knots: np.ndarray) -> BSpline:
    from scipy.interpolate import BSpline
    from scipy.sparse import vstack
    from scipy.sparse.linalg import spsolve

    inner = knots[DEGREE:-DEGREE]
    # four places per interval: snap is a cubic there, so together they leave only cubics open
    places = (np.arange(4) + 0.5) / 4.0
    between = (inner[:-1, None] + np.diff(inner)[:, None] * places).ravel()
    rows, right = [], []
    for order, (samples, weight) in enumerate(zip(given, (1.0, RATE, ACCELERATION), strict=True)):
        if samples is not None:
            rows.append(weight * _basis(times, knots, order))
            right.append(weight * samples)
    size = given.values.shape[1]
    for order, weight in ((4, SNAP), (2, LEAST_ACCELERATION)):  # few samples have one solution, too
        rows.append(weight * _basis(between, knots, order))
        right.append(np.zeros((len(between), size)))
    if len(times) > DENSE * len(inner):
        # a curve ends with nothing beyond it: the noise of the last rows would be its jerk and snap
        ends = np.unique([*between[: 4 * END_PIECES], *between[-4 * END_PIECES :]])
        step = min(COARSEST, inner[1] - inner[0])
        rows.append(END * (step / COARSEST) ** 6 * _basis(ends, knots, 6))
        right.append(np.zeros((len(ends), size)))
    matrix, target = vstack(rows).tocsc(), np.concatenate(right)
    if np.diff(times).max() > LONG_GAP:
        return BSpline(knots, _solved_by_qr(matrix.tocsr(), target), DEGREE)
    solution = spsolve((matrix.T @ matrix).tocsc(), matrix.T @ target)
    return BSpline(knots, solution.reshape(-1, size), DEGREE)


def _solved_by_qr(matrix: csr_matrix, target: np.ndarray) -> np.ndarray:
    """Return the least-squares solution (n, k) by QR of the band.

    The normal equations square the ratio of the weights; this does not.
    """
    matrix.sum_duplicates()  # sorts the columns, too
    filled = np.flatnonzero(np.diff(matrix.indptr))
    first = matrix.indices[matrix.indptr[filled]]
    order = np.argsort(first, kind="stable")
    counts = np.diff(matrix.indptr)[filled]
    band = np.zeros((len(filled), DEGREE + 1))
    band[np.repeat(np.arange(len(filled)), counts), matrix.indices - np.repeat(first, counts)] = (
        matrix.data
    )
    first, band = first[order], band[order]
    return _band_solved(first, band, target[filled[order]], matrix.shape[1])


def _band_solved(first: np.ndarray, band: np.ndarray, target: np.ndarray, n: int) -> np.ndarray:
    """Return the least-squares solution (n, k) of rows (m, w) that begin at columns first (m,).

    first must not decrease; target (m, k).
    """
    width, size = band.shape[1], target.shape[1]
    upper, right = np.zeros((n, width)), np.zeros((n, size))
    given = np.hstack([band, target])
    starts = np.searchsorted(first, np.arange(n + 1))
    open_rows = np.zeros((0, width + size))  # triangular, of the columns from j on
    for j in range(n):
        together = np.vstack([open_rows, given[starts[j] : starts[j + 1]]])
        triangle = np.linalg.qr(together, mode="r")[:width]
        upper[j], right[j] = triangle[0, :width], triangle[0, width:]
        open_rows = np.zeros((len(triangle) - 1, width + size))
        open_rows[:, : width - 1] = triangle[1:, 1:width]
        open_rows[:, width:] = triangle[1:, width:]
    for j in range(n - 1, -1, -1):
        inner = min(width, n - j)
        right[j] = (right[j] - upper[j, 1:inner] @ right[j + 1 : j + inner]) / upper[j, 0]
    return right


def _basis(times: np.ndarray, knots: np.ndarray, order: int) -> csc_matrix:
    """Return the matrix from the coefficients to derivative `order` at the times."""
    from scipy.interpolate import BSpline
    from scipy.sparse import diags

    change, degree = None, DEGREE
    for _ in range(order):
        width = degree / (knots[degree + 1 : -1] - knots[1 : -degree - 1])
        count = len(width)
        step = diags([-width, width], [0, 1], shape=(count, count + 1))
        change = step if change is None else step @ change
        knots, degree = knots[1:-1], degree - 1
    basis = BSpline.design_matrix(times, knots, degree)
    return basis if change is None else basis @ change


def _polynomials(spline: BSpline) -> Polynomials:
    knots = spline.t[DEGREE:-DEGREE]
    width, powers, scale = np.diff(knots)[:, None], [], 1.0
    for order in range(DEGREE + 1):
        scale *= max(order, 1)
        rows = _basis(knots[:-1], spline.t, order) @ spline.c
        powers.append(rows * width**order / scale)
    return Polynomials(knots, np.array(powers).swapaxes(0, 1))
