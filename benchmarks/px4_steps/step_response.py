"""What is compared of two step responses: figures of a curve, and the distance of two curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

REACHED = 0.632  # of the step: one time constant of a first-order lag


@dataclass(frozen=True)
class StepFigures:
    """time_constant [s]: until REACHED of the step; overshoot, final: as shares of the step.

    final: mean of the last quarter. NaN for a time that is never reached.
    """

    time_constant: float
    overshoot: float
    final: float


def figures(time: np.ndarray, response: np.ndarray) -> StepFigures:
    """Return the figures of a response (n,) to a step of 1 at time 0; time (n,) [s] ascending."""
    after = time >= 0.0
    t, y = time[after], response[after]
    above = np.flatnonzero(y >= REACHED)
    reached = np.nan
    if len(above):
        i = above[0]
        reached = t[i]
        if i > 0:  # between two samples
            reached = t[i - 1] + (t[i] - t[i - 1]) * (REACHED - y[i - 1]) / (y[i] - y[i - 1])
    last = y[-max(1, len(y) // 4) :]
    return StepFigures(float(reached), float(max(0.0, y.max() - 1.0)), float(last.mean()))


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """RMS difference of two responses (n,) to the same step of 1, as a share of it."""
    return float(np.sqrt(np.mean(np.square(one - other))))
