"""The clock of a path: it runs, slows down to a stop, restarts, or runs backwards."""

import math
from typing import TypeVar

import numpy as np

from uam_control.coordinates import CHI_DDOT, CHI_DOT, JERK, SNAP

Stamps = TypeVar("Stamps", float, np.ndarray)
STEADY = (1.0, 0.0, 0.0, 0.0)  # derivatives of a time that passes as the stamps do


def scale(path: np.ndarray, rates: tuple[float, float, float, float]) -> None:
    """Apply the derivatives of the path's time to path (5, k), by the chain rule.

    rates [1, 1/s, 1/s^2, 1/s^3]: first to fourth derivative.
    """
    one, two, three, four = rates
    path[SNAP] = (
        one**4 * path[SNAP]
        + 6.0 * one**2 * two * path[JERK]
        + (4.0 * one * three + 3.0 * two**2) * path[CHI_DDOT]
        + four * path[CHI_DOT]
    )
    path[JERK] = one**3 * path[JERK] + 3.0 * one * two * path[CHI_DDOT] + three * path[CHI_DOT]
    path[CHI_DDOT] = one**2 * path[CHI_DDOT] + two * path[CHI_DOT]
    path[CHI_DOT] *= one


class PathClock:
    """Scenario time as a function of the stamp: it advances, slows down to a stop, or restarts.

    During a change its rate is a cubic polynomial of the stamp; rate and slope are continuous.
    """

    def __init__(self, stamp: float) -> None:
        """stamp [s] at which the scenario begins."""
        self._begin = stamp
        self._ramp: tuple[float, float, float, float, float, float] | None = None
        self._end: tuple[float, ...] = ()  # see `_on_ramp`, at the end of the ramp

    def at(self, stamp: float) -> tuple[float, float, float, float, float]:
        """Return scenario time [s] and its first to fourth derivative [1, 1/s, 1/s^2, 1/s^3]."""
        if self._ramp is None:
            return self.settled_at(stamp), 1.0, 0.0, 0.0, 0.0
        begin, length, time, *_ = self._ramp
        elapsed = stamp - begin
        if elapsed >= length:  # for most of a flight: only the time changes
            return self.settled_at(stamp), *self._end[1:]
        gained, one, two, three, four = self._on_ramp(max(elapsed / length, 0.0))
        return time + gained, one, two, three, four

    def settled_at(self, stamp: Stamps) -> Stamps:
        """Return scenario times [s] of stamps [s] from `settled` on."""
        if self._ramp is None:
            return stamp - self._begin
        begin, length, time, _, _, goal = self._ramp
        return time + (goal * (stamp - begin - length) + self._end[0])

    def _on_ramp(self, u: float) -> tuple[float, float, float, float, float]:
        """Return the scenario time [s] since the begin of the ramp, and its derivatives.

        u = 0..1: part of the ramp's length that has passed.
        """
        _, length, _, rate, slope, goal = self._ramp
        gained = length * (
            rate * (u - u**3 + u**4 / 2)
            + length * slope * (u**2 / 2 - 2 * u**3 / 3 + u**4 / 4)
            + goal * (u**3 - u**4 / 2)
        )
        now = rate * (1 - 3 * u**2 + 2 * u**3) + goal * (3 * u**2 - 2 * u**3)
        now += length * slope * (u - 2 * u**2 + u**3)
        change = (goal - rate) * 6 * (u - u**2) / length + slope * (1 - 4 * u + 3 * u**2)
        if not 0.0 < u < 1.0:
            return gained, now, change, 0.0, 0.0
        third = (goal - rate) * 6 * (1 - 2 * u) / length**2 + slope * (6 * u - 4) / length
        fourth = (rate - goal) * 12 / length**3 + slope * 6 / length**2
        return gained, now, change, third, fourth

    @property
    def goal(self) -> float:
        """Return the rate [1] to which the clock changes, or has changed."""
        return 1.0 if self._ramp is None else self._ramp[-1]

    @property
    def settled(self) -> float:
        """Return the stamp [s] from which on the rate is constant."""
        return -math.inf if self._ramp is None else self._ramp[0] + self._ramp[1]

    def change(self, stamp: float, goal: float, length: float) -> None:
        """Change the rate to `goal` [1] within `length` [s] from `stamp` [s], unless it does so."""
        if self._ramp is not None and goal == self.goal:
            return
        self._ramp = (stamp, length, *self.at(stamp)[:3], goal)
        self._end = self._on_ramp(1.0)
