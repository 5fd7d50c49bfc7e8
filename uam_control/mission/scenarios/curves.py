"""Closed curves as references: circle, ellipse, lemniscate, with ramps in and out of speed.

A curve is a sum of harmonics of the angle theta; theta is a polynomial of time from rest to rest.
The composition is sampled with value, rate, acceleration, jerk and snap, and interpolated by
polynomials of degree 9 through them; the error is below 1e-9 m.
"""

import math
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import POSITION, YAW
from uam_control.mission.motion.polynomials import ROWS, Polynomials, hermite

KNOT = 0.1  # [rad] of theta and [s], largest distance of two knots
TURN = 2.0 * math.pi
DERIVATIVES = ROWS + 2  # of the harmonics: yaw along the tangent needs two more than its own


@dataclass(frozen=True)
class Harmonic:
    """amplitude * sin(frequency * theta + phase) of one coordinate, [m] or [rad]."""

    column: int
    amplitude: float
    frequency: float
    phase: float = 0.0


def circle(radius: float) -> tuple[Harmonic, ...]:
    """Return the circle of `radius` [m]; it begins at x = radius, counter-clockwise."""
    return ellipse(2.0 * radius, 2.0 * radius)


def ellipse(length: float, width: float) -> tuple[Harmonic, ...]:
    """Return the ellipse of length x width [m]; it begins at x = length / 2, counter-clockwise."""
    return Harmonic(0, length / 2, 1.0, math.pi / 2), Harmonic(1, width / 2, 1.0)


def lemniscate(length: float, width: float) -> tuple[Harmonic, ...]:
    """Return the figure of eight (Gerono) of length x width [m]; it begins in its middle."""
    return Harmonic(0, length / 2, 1.0), Harmonic(1, width / 2, 2.0)


def rise(height: float) -> tuple[Harmonic, ...]:
    """Return a height that goes up by `height` [m] and back once per lap; zero at theta = 0."""
    return (Harmonic(2, height / 2, 1.0, -math.pi / 2),)  # its mean is height / 2


def derivatives(
    harmonics: tuple[Harmonic, ...], theta: np.ndarray, count: int, size: int
) -> np.ndarray:
    """Return the sum of the harmonics and its derivatives in theta (m,) [rad]: (count, m, size)."""
    found = np.zeros((count, len(theta), size))
    for h in harmonics:
        for k in range(count):
            angle = h.frequency * theta + h.phase + k * math.pi / 2
            found[k, :, h.column] += h.amplitude * h.frequency**k * np.sin(angle)
    return found


def largest_slope(harmonics: tuple[Harmonic, ...]) -> float:
    """Return the largest |dp / dtheta| [m/rad] of the position."""
    return float(_slopes(harmonics).max())


def lap_length(harmonics: tuple[Harmonic, ...]) -> float:
    """Return the length [m] of the way of one turn of theta."""
    return TURN * float(_slopes(harmonics)[:-1].mean())


def _slopes(harmonics: tuple[Harmonic, ...]) -> np.ndarray:
    """Return |dp / dtheta| (721,) [m/rad] of the position along one turn."""
    moving = tuple(h for h in harmonics if h.column < POSITION.stop)
    slope = derivatives(moving, np.linspace(0.0, TURN, 721), 2, POSITION.stop)[1]
    return np.linalg.norm(slope, axis=1)


def steady(turns: float, period: float, ramp: float) -> Polynomials:
    """Return theta [rad] over time: ramp up, turns at constant speed, ramp down.

    turns: of theta in all, the ramps included; period [s] of one turn at speed; ramp [s]: length of
    each ramp, at most turns * period.
    """
    speed, length = TURN / period, turns * period + ramp
    rows = np.zeros((ROWS, 4, 1))
    rows[0, :, 0] = 0.0, speed * ramp / 2, TURN * turns - speed * ramp / 2, TURN * turns
    rows[1, 1:3] = speed
    knots = np.array([0.0, ramp, length - ramp, length])
    if length - 2.0 * ramp < 1e-9:
        return hermite(knots[[0, 1, 3]], rows[:, [0, 1, 3]])
    return hermite(knots, rows)


def swept(turns: float, duration: float) -> Polynomials:
    """Return theta [rad] from rest to rest within `duration` [s]: a quintic, minimum jerk."""
    rows = np.zeros((3, 2, 1))
    rows[0, 1] = TURN * turns
    return hermite(np.array([0.0, duration]), rows)


def follow(
    harmonics: tuple[Harmonic, ...],
    theta: Polynomials,
    middle: np.ndarray,
    tangent: bool = False,
    yaw_turns: float = 0.0,
) -> Polynomials:
    """Return the reference that follows the curve.

    theta [rad] over time; middle (n,): chi about which the harmonics swing. tangent: yaw in the
    direction of the motion; else yaw_turns per turn of theta, added to that of `middle`.
    """
    fastest = max(h.frequency for h in harmonics) * np.abs(theta.rows(_grid(theta), 2)[1]).max()
    knots = _knots(theta, min(KNOT, KNOT / fastest))
    angle = theta.rows(knots)[:, :, 0]
    angle[:, 0], angle[:, -1] = (row[:, 0] for row in theta.ends())
    slopes = derivatives(harmonics, angle[0], DERIVATIVES, len(middle))
    if tangent:
        slopes[:ROWS, :, YAW] = _heading(slopes[:, :, POSITION])
        middle = middle.copy()
        middle[YAW] = 0.0
    else:
        slopes[0, :, YAW] += yaw_turns * angle[0]
        slopes[1, :, YAW] += yaw_turns
    rows = _composed(slopes[:ROWS], angle)
    rows[0] += middle
    return hermite(knots, rows)


def _grid(curve: Polynomials) -> np.ndarray:
    return np.linspace(curve.knots[0], curve.knots[-1], 500)


def _knots(theta: Polynomials, step: float) -> np.ndarray:
    """Return the knots of theta with others between them, at most `step` [s] apart."""
    found = [theta.knots[:1]]
    for a, b in zip(theta.knots[:-1], theta.knots[1:], strict=True):
        found.append(np.linspace(a, b, math.ceil((b - a) / step) + 1)[1:])
    return np.concatenate(found)


def _series(rows: np.ndarray) -> np.ndarray:
    """Return the coefficients of the Taylor series of derivatives 0, 1, ... in the first axis."""
    scale = np.array([math.factorial(i) for i in range(len(rows))], dtype=float)
    return rows / scale.reshape(-1, *[1] * (rows.ndim - 1))


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the truncated product of two series (k, m)."""
    return np.array([sum(a[i] * b[k - i] for i in range(k + 1)) for k in range(len(a))])


def _quotient(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the truncated quotient a / b of two series (k, m)."""
    found: list[np.ndarray] = []
    for k in range(len(a)):
        found.append((a[k] - sum(b[i] * found[k - i] for i in range(1, k + 1))) / b[0])
    return np.array(found)


def _heading(position: np.ndarray) -> np.ndarray:
    """Return the direction of the motion [rad], and its derivatives in theta, (ROWS, m).

    position: derivatives in theta (DERIVATIVES, m, 3), first the position itself.
    """
    count = ROWS - 1
    x1, y1 = (_series(position[1 : count + 1, :, i]) for i in (0, 1))
    x2, y2 = (_series(position[2 : count + 2, :, i]) for i in (0, 1))
    rate = _quotient(
        _product(x1, y2) - _product(y1, x2), _product(x1, x1) + _product(y1, y1)
    )  # d yaw / d theta
    scale = np.array([math.factorial(i) for i in range(count)], dtype=float)[:, None]
    yaw = np.unwrap(np.arctan2(position[1, :, 1], position[1, :, 0]))
    return np.concatenate([yaw[None], rate * scale])


def _composed(slopes: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return derivatives in time (ROWS, m, n) from those in theta and those of theta (ROWS, m)."""
    series, delta = _series(slopes), _series(angle)
    delta[0] = 0.0
    found, power = np.zeros_like(series), np.zeros_like(delta)
    power[0] = 1.0
    for k in range(ROWS):
        found += power[:, :, None] * series[k]
        power = _product(power, delta)
    scale = np.array([math.factorial(i) for i in range(ROWS)], dtype=float)
    return found * scale[:, None, None]
