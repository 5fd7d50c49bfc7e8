"""Plant time against the wall clock: when a tick is due, and which wall time it has.

A plant that is late runs at most CATCH_UP times as fast until it is on time again. One that is late
by more than LATEST lets this time go: the world has then stood still for this time, and everything
that is stamped stays as old as LATEST at most, as the clock of the autopilot (`OwnClock`) requires.
"""

from __future__ import annotations

import time
from collections.abc import Callable

CATCH_UP = 2.0  # [1] fastest rate after a stall
SHORTEST = 0.0005  # [s] a sleep takes longer than shorter ones
LATEST = 0.02  # [s] lateness from which time is let go


class PacedClock:
    """`lost`: time let go so far [s]; `late`: ticks begun later than a period; `begun`: ticks."""

    def __init__(
        self,
        period: float,
        steady: Callable[[], float] = time.monotonic,
        system: Callable[[], float] = time.time,
    ) -> None:
        """period [s] of a tick; steady, system: clocks [s]."""
        self._period, self._steady, self._system = period, steady, system
        self.lost, self.late, self.begun = 0.0, 0, 0
        self._origin = self._newest = steady()  # steady time of tick 0, of the newest tick
        self._offset = system() - self._origin  # system time − steady time

    def begin(self) -> None:
        """Begin with tick 0 now."""
        self._origin = self._newest = self._steady()
        self._offset = self._system() - self._origin

    def host(self, tick: int) -> float:
        """Return the system's time [s] at which `tick` is due."""
        return self._origin + tick * self._period + self._offset

    def left(self, tick: int) -> float:
        """Return the time [s] to sleep until `tick` may begin, 0 if it is due."""
        due = self._origin + tick * self._period
        left = max(due, self._newest + self._period / CATCH_UP) - self._steady()
        return left if left > SHORTEST else 0.0

    def note(self, tick: int) -> None:
        """Note that `tick` begins now."""
        self._newest = now = self._steady()
        late = now - self._origin - tick * self._period
        self.begun += 1
        self.late += late > self._period
        if late > LATEST:
            self._origin += late
            self.lost += late
