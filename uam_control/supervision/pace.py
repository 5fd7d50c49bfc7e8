"""Stamps against the wall clock: how much slower a simulation runs, and which ticks have waited.

An autopilot with its own clock (hardware in the loop) cannot fly a vehicle whose time passes more
slowly: its rate loop and its estimator integrate over the wrong time.
"""

import math
from collections import deque

from uam_control.ages import STALE

WINDOW = 1.0  # [s] of the wall clock
FALLS = 0.02  # [s] by which the lag falls while what has waited arrives


class Pace:
    """`slower`: 1 − real-time factor of the last WINDOW, NaN before that; below 0: faster."""

    def __init__(self) -> None:
        self.slower = math.nan
        self._seen: deque[tuple[float, float]] = deque()  # wall clock, stamp [s]

    def tick(self, stamp: float, wall: float) -> None:
        """Register the tick `stamp` [s] at the wall clock's time `wall` [s]."""
        seen = self._seen
        if seen and (stamp < seen[-1][1] or wall < seen[-1][0]):  # a clock that began anew
            seen.clear()
            self.slower = math.nan
        seen.append((wall, stamp))
        while len(seen) > 2 and wall - seen[1][0] >= WINDOW:
            seen.popleft()
        begun, first = seen[0]
        if wall - begun >= WINDOW:
            self.slower = 1.0 - (stamp - first) / (wall - begun)


class Waited:
    """Finds the ticks that have waited while a process stood still: they are old.

    The lag of a tick is the wall clock's time less its stamp. A lag that is larger than before by
    more than STALE, and falls, is that of ticks that have waited. If it stays for STALE, the time
    of the stamps stood still, too: no tick has waited.
    """

    def __init__(self) -> None:
        self._lag = self._late = self._since = math.inf

    def late(self, stamp: float, wall: float) -> float:
        """Return for how long [s] the tick `stamp` [s], which begins at `wall` [s], has waited."""
        lag = wall - stamp
        if lag - self._lag > STALE:
            if lag < self._late - FALLS:
                self._late, self._since = lag, wall
            if wall - self._since < STALE:
                return lag - self._lag
        self._lag, self._late = lag, math.inf
        return 0.0
