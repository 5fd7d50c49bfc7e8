"""Gaps between rows so long that the rows do not say where the curve between them is.

The fit is least in snap; over a gap much longer than those beside it such a curve swings out. A
gap is checked against the box of its two rows and of the way that their rates point to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.mission.motion.polynomials import Polynomials
from uam_control.mission.scenarios.fitted_spline import COARSEST, CurveSamples

PLACES = 32  # at which a gap is checked
OUTSIDE, OF_DISTANCE = 0.2, 0.5  # [m or rad] and of the distance of the rows: the rest is a swing


class Swing(NamedTuple):
    """The curve between row and row + 1 leaves them in a column by distance [m or rad]."""

    row: int
    column: int
    distance: float


def worst_swing(times: np.ndarray, samples: CurveSamples, curve: Polynomials) -> Swing | None:
    """Return the swing that exceeds its bound most, None if no gap has one.

    times (m,) [s] of the samples; curve: their fit.
    """
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
