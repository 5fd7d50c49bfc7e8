"""Piecewise polynomials: smooth references with value, rate, acceleration, jerk and snap."""

from __future__ import annotations

import math

import numpy as np

from uam_control.coordinates import CHI, CHI_DDOT, CHI_DOT
from uam_control.maths.compiled import jit

ROWS = 5  # value, rate, acceleration, jerk, snap
# A move from rest to rest whose rate, acceleration, jerk and snap are zero at both ends, degree 9:
PEAK_RATE = 315.0 / 128.0  # its largest rate, times distance / duration
PEAK_ACCELERATION = 9.372  # its largest acceleration, times distance / duration^2
# The same of a quintic, and the largest slope of a cubic times its mean slope
PEAK, HARDEST, RAMP = 1.875, 5.7735, 1.5


class Polynomials:
    """Polynomials of the mission time between knots; at rest before the first and after the last.

    knots (k + 1,) [s], increasing; coefficients (k, d + 1, n): of the powers of u = 0..1 in each
    interval, for n coordinates.
    """

    def __init__(self, knots: np.ndarray, coefficients: np.ndarray) -> None:
        self.knots = np.ascontiguousarray(knots, dtype=float)
        self.coefficients = np.ascontiguousarray(coefficients, dtype=float)

    @property
    def length(self) -> float:
        """Return the time [s] from the first to the last knot."""
        return float(self.knots[-1] - self.knots[0])

    @property
    def first(self) -> np.ndarray:
        """Return the value (n,) at the first knot."""
        return self.coefficients[0, 0].copy()

    @property
    def last(self) -> np.ndarray:
        """Return the value (n,) at the last knot."""
        return self.coefficients[-1].sum(axis=0)

    def write(self, time: float, reference: np.ndarray) -> None:
        """Write value, rate, acceleration, ... at time [s], as many rows as reference (r, n)."""
        write_polynomials(time, self.knots, self.coefficients, reference)

    def rows(self, times: np.ndarray, count: int = ROWS) -> np.ndarray:
        """Return value, rate, ... (count, m, n) at times (m,) [s]."""
        found = np.empty((len(times), count, self.coefficients.shape[2]))
        _write_all(np.asarray(times, dtype=float), self.knots, self.coefficients, found)
        return found.swapaxes(0, 1)

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Return value, rate, ... (ROWS, n) just after the first and just before the last knot."""
        found = np.empty((2, ROWS, self.coefficients.shape[2]))
        widths = np.diff(self.knots)
        for row, interval, u in zip(found, (0, -1), (0.0, 1.0), strict=True):
            _interval_rows(u, widths[interval], self.coefficients[interval], row)
        return found[0], found[1]

    def slowed(self, factor: float) -> Polynomials:
        """Return the same curve, `factor` times as slow from the first knot on."""
        knots = self.knots[0] + factor * (self.knots - self.knots[0])
        return Polynomials(knots, self.coefficients)

    def shifted(self, time: float, value: np.ndarray | float = 0.0) -> Polynomials:
        """Return it `time` [s] later, with `value` (n,) added."""
        coefficients = self.coefficients.copy()
        coefficients[:, 0] += value
        return Polynomials(self.knots + time, coefficients)


def joined(parts: list[Polynomials]) -> Polynomials:
    """Return the parts one after the other, each from the end of the one before on."""
    knots = [np.zeros(1)]
    for part in parts:
        knots.append(knots[-1][-1] + part.knots[1:] - part.knots[0])
    return Polynomials(np.concatenate(knots), np.concatenate(_of_one_degree(*parts)))


def added(one: Polynomials, other: Polynomials) -> Polynomials:
    """Return the sum of two curves with the same knots."""
    return Polynomials(one.knots, np.add(*_of_one_degree(one, other)))


def _of_one_degree(*parts: Polynomials) -> list[np.ndarray]:
    """Return the coefficients, those of lower degrees with zeros."""
    degree = max(part.coefficients.shape[1] for part in parts)
    return [
        np.pad(part.coefficients, ((0, 0), (0, degree - part.coefficients.shape[1]), (0, 0)))
        for part in parts
    ]


def hermite(knots: np.ndarray, rows: np.ndarray) -> Polynomials:
    """Return polynomials of degree 2 r - 1 through value, rate, ... at each of the knots.

    knots (k + 1,) [s]; rows (r, k + 1, n).
    """
    order = len(rows)
    widths = np.diff(knots)[:, None]
    scale = np.array([widths**i for i in range(order)])
    begin, end = rows[:, :-1] * scale, rows[:, 1:] * scale
    factorials = np.array([math.factorial(i) for i in range(order)], dtype=float)
    low = begin / factorials[:, None, None]
    # derivative r of u^j at u = 1
    at_one = np.array(
        [[math.perm(j, i) for j in range(2 * order)] for i in range(order)], dtype=float
    )
    missing = end - np.tensordot(at_one[:, :order], low, axes=1)
    high = np.tensordot(np.linalg.inv(at_one[:, order:]), missing, axes=1)
    return Polynomials(knots, np.concatenate([low, high]).swapaxes(0, 1))


def rest_to_rest(start: np.ndarray, goal: np.ndarray, length: float) -> Polynomials:
    """Return the move from start to goal (n,) within `length` [s]; see PEAK_RATE."""
    rows = np.zeros((ROWS, 2, len(start)))
    rows[0] = start, goal
    return hermite(np.array([0.0, length]), rows)


def ramp_up(goal: np.ndarray, length: float) -> Polynomials:
    """Return a curve from rest, within `length` [s], to goal (ROWS, n).

    Its begin follows from the goal: the rate is a polynomial without a condition on the way.
    """
    rates = np.zeros((ROWS - 1, 2, goal.shape[1]))
    rates[:, 1] = goal[1:]
    powers = hermite(np.array([0.0, length]), rates).coefficients[0]
    way = length * powers / np.arange(1, len(powers) + 1)[:, None]
    begin = goal[0] - way.sum(axis=0)
    return Polynomials(np.array([0.0, length]), np.concatenate([begin[None], way])[None])


def reversed_in_time(curve: Polynomials) -> Polynomials:
    """Return a curve of one interval, flown backwards."""
    (powers,) = curve.coefficients
    mirrored = np.zeros_like(powers)
    for j, row in enumerate(powers):  # (1 - u)^j
        for i in range(j + 1):
            mirrored[i] += math.comb(j, i) * (-1) ** i * row
    return Polynomials(curve.knots, mirrored[None])


@jit
def write_polynomials(
    time: float, knots: np.ndarray, coefficients: np.ndarray, reference: np.ndarray
) -> None:
    """Write value, rate, ... at time [s] to reference (r, n); see `Polynomials`."""
    reference[:] = 0.0
    last = len(knots) - 2
    if time <= knots[0]:
        reference[0] = coefficients[0, 0]
        return
    if time >= knots[last + 1]:
        for i in range(coefficients.shape[2]):
            for j in range(coefficients.shape[1]):
                reference[0, i] += coefficients[last, j, i]
        return
    k = min(np.searchsorted(knots, time, side="right") - 1, last)
    width = knots[k + 1] - knots[k]
    _interval_rows((time - knots[k]) / width, width, coefficients[k], reference)


@jit
def _write_all(
    times: np.ndarray, knots: np.ndarray, coefficients: np.ndarray, references: np.ndarray
) -> None:
    """Write the references (m, r, n) at times (m,) [s]."""
    for i in range(len(times)):
        write_polynomials(times[i], knots, coefficients, references[i])


@jit
def _interval_rows(u: float, width: float, powers: np.ndarray, reference: np.ndarray) -> None:
    """Write value, rate, ... at u to reference (r, n); powers (d + 1, n); width [s]."""
    rows = len(reference)
    for i in range(powers.shape[1]):
        for r in range(rows):
            reference[r, i] = 0.0
        for j in range(powers.shape[0] - 1, -1, -1):  # Horner's scheme, with derivatives / r!
            for r in range(rows - 1, 0, -1):
                reference[r, i] = reference[r, i] * u + reference[r - 1, i]
            reference[0, i] = reference[0, i] * u + powers[j, i]
        scale = 1.0
        for r in range(1, rows):
            scale *= r / width
            reference[r, i] *= scale


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
