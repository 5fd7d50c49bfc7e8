"""How much slower than the wall clock a simulation runs.

An autopilot with its own clock (hardware in the loop) cannot fly a vehicle whose time passes more
slowly: its rate loop and its estimator integrate over the wrong time.
"""

from __future__ import annotations

import math
from collections import deque

WINDOW = 1.0  # [s] of the wall clock


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
