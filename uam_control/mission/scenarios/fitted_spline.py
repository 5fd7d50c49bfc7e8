"""Smooth interpolation of samples: a spline of degree 7, with six continuous derivatives.

Rows alone say moves between rests; gaps may be so long that they say too little.

The spline is the least-squares fit to values and, where they are given, rates and accelerations.
The knots lie close enough that it passes every value within a tolerance. A planner's file has
rounded numbers, and rates and accelerations that belong only approximately to its positions; an
interpolation through all of them (quintic Hermite) has jumps in the jerk. This one has none.

The fit is least in snap; over a gap much longer than those beside it such a curve swings out. A
gap is checked against the box of its two rows and of the way that their rates point to.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uam_control.mission.motion.polynomials import Polynomials
from uam_control.mission.motion.trajectory import Move

if TYPE_CHECKING:
    from scipy.interpolate import BSpline
    from scipy.sparse import csc_matrix

# scipy is imported where it is used: that takes most of a second, and few processes read a file

DEGREE = 7
COARSEST = 0.2  # [s] distance of the knots in the first attempt, or that of the samples
LONG_GAP = 2.0  # [s] between two samples: the normal equations lose the curve in longer ones
RESIDUALS = 1e-4  # of their scale there
ATTEMPTS = 5  # each with knots at half the distance
# A unit of misfit in rate, acceleration and snap weighs as much as these in value [s, s^2, s^4].
RATE, ACCELERATION, SNAP = 1e-2, 1e-3, 5e-9
END, END_PIECES = 3e-7, 2  # [s^6] of the sixth derivative in so many intervals at either end
DENSE = 1.5  # rows per interval, from which on
LEAST_ACCELERATION = 1e-6  # [s^2] of acceleration itself: decides where under four samples do not
PLACES = 32  # at which a gap is checked
OUTSIDE, OF_DISTANCE = 0.2, 0.5  # [m or rad] and of the distance of the rows: the rest is a swing
SHORTEST_PAUSE, PAUSE_STEP = 0.5, 0.1  # [s] of a pause; between the rows that it gets
SLOW = 1e-3  # [m/s], [rad/s] below which a coordinate rests


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


def with_pauses(
    numbers: np.ndarray, t: int, moving: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows (m, k) with more of them in each pause, and the given row of each.

    A pause: two rows with the same values in the columns `moving`; t: the column of time [s].
    """
    rows, of = [numbers[:1]], [0]
    for i, (one, other) in enumerate(zip(numbers, numbers[1:], strict=False)):
        if other[t] - one[t] > SHORTEST_PAUSE and np.array_equal(one[moving], other[moving]):
            count = math.ceil((other[t] - one[t]) / PAUSE_STEP)
            inner = np.repeat(one[None], count - 1, axis=0)
            inner[:, t] = np.linspace(one[t], other[t], count + 1)[1:-1]
            rows.append(inner)
            of += [i] * len(inner)
        rows.append(other[None])
        of.append(i + 1)
    return np.vstack(rows), np.array(of)


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
        inner = np.linspace(times[0], times[-1], max(1, round(span / step)) + 1)
        knots = np.concatenate([[times[0]] * DEGREE, inner, [times[-1]] * DEGREE])
        found = [_solved(times, group, knots) for group in groups]
        apart = np.array(
            [
                np.abs(spline(times) - group.values).max(axis=1)
                for spline, group in zip(found, groups, strict=True)
            ]
        )
        if apart.max() <= tolerance:
            return [of_spline(spline) for spline in found]
        step /= 2.0
    worst, row = np.unravel_index(np.argmax(apart), apart.shape)
    raise Misfit(int(worst), int(row), float(apart.max()))


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
        return BSpline(knots, least_squares(matrix, target), DEGREE)
    solution = spsolve((matrix.T @ matrix).tocsc(), matrix.T @ target)
    return BSpline(knots, solution.reshape(-1, size), DEGREE)


def least_squares(matrix: csc_matrix, target: np.ndarray) -> np.ndarray:
    """Return the least-squares solution (n, k) of rows (m, n), target (m, k).

    With the residuals as unknowns: the normal equations square the ratio of the weights.
    """
    from scipy.sparse import bmat, identity
    from scipy.sparse.linalg import spsolve

    rows, columns = matrix.shape
    both = bmat([[RESIDUALS * identity(rows), matrix], [matrix.T, None]]).tocsc()
    filled = np.vstack([target, np.zeros((columns, target.shape[1]))])
    return spsolve(both, filled).reshape(len(filled), -1)[rows:]


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


def of_spline(spline: BSpline) -> Polynomials:
    """Return a spline of degree DEGREE as polynomials."""
    knots = spline.t[DEGREE:-DEGREE]
    width, powers, scale = np.diff(knots)[:, None], [], 1.0
    for order in range(DEGREE + 1):
        scale *= max(order, 1)
        rows = _basis(knots[:-1], spline.t, order) @ spline.c
        powers.append(rows * width**order / scale)
    return Polynomials(knots, np.array(powers).swapaxes(0, 1))


class Swing(NamedTuple):
    """The curve between row and row + 1 leaves them in a column by distance [m or rad]."""

    row: int
    column: int
    distance: float


def worst_swing(times: np.ndarray, samples: CurveSamples, curve: Polynomials) -> Swing | None:
    """Return the swing of the fit that exceeds its bound most, if a gap has one; times (m,) [s]."""
    gaps = np.flatnonzero(np.diff(times) > COARSEST)
    if not len(gaps):
        return None
    values, width = samples.values, np.diff(times)[gaps, None]
    rates = _slopes(times, values) if samples.rates is None else samples.rates
    first, last = values[gaps], values[gaps + 1]
    # control points of the cubic through values and rates: it lies within their box
    corners = (first, last, first + rates[gaps] * width / 3, last - rates[gaps + 1] * width / 3)
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    share = np.linspace(0.0, 1.0, PLACES)
    places = times[gaps, None] + width * share
    flown = curve.rows(places.ravel(), 1)[0].reshape(len(gaps), PLACES, -1)
    beyond = np.maximum(flown - high[:, None], low[:, None] - flown).max(axis=1)
    allowed = OUTSIDE + OF_DISTANCE * np.linalg.norm(last - first, axis=1)
    gap, column = np.unravel_index(np.argmax(beyond - allowed[:, None]), beyond.shape)
    if beyond[gap, column] <= allowed[gap]:
        return None
    return Swing(int(gaps[gap]), int(column), float(beyond[gap, column]))


def _slopes(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the rates (m, n) by the rows beside each row."""
    beside = np.arange(len(times))
    before, after = np.maximum(beside - 1, 0), np.minimum(beside + 1, len(times) - 1)
    return (values[after] - values[before]) / (times[after] - times[before])[:, None]


def between_rests(times: np.ndarray, values: Mapping[str, np.ndarray]) -> tuple[Move, ...]:
    """Return the moves of coordinates between rests and turns.

    times (m,) [s]; values: coordinate -> samples (m,) [m or rad]. The height has a move that ends
    at the first sample: the way there.
    """
    found = [Move("z", float(times[0]) - 1.0, float(times[0]), float(values["z"][0]))]
    for name, samples in values.items():
        rates = np.diff(samples) / np.diff(times)
        ways = np.where(np.abs(rates) > SLOW, np.sign(rates), 0.0)
        edges = np.flatnonzero(np.diff(ways, prepend=0.0, append=0.0))
        for first, last in zip(edges, edges[1:], strict=False):
            if ways[first]:
                found.append(
                    Move(name, float(times[first]), float(times[last]), float(samples[last]))
                )
    return tuple(found)
