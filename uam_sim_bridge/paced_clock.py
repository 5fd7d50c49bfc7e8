"""Ticks and waits against the wall clock: when a tick is due, which time it has, when a wait ends.

A plant that is late runs a little faster until it is on time again, but not in a burst: the other
nodes could not follow. One that is late by more than `latest` lets this time go: the world has then
stood still for this time, and everything that is stamped stays as old as that at most, as an
autopilot with a clock of its own requires. The cycles of the servo bus have the same rules, but no
limit to how fast they catch up: nothing waits for them.
"""

import time
from collections.abc import Callable

CATCH_UP = 2.0  # [1] fastest rate after a stall, of a rehearsal
SHORTEST = 0.0005  # [s] a sleep takes longer than shorter ones
LATEST = 0.02  # [s] lateness that such an autopilot does not notice
SLICE = 0.5  # s, most that counts between two readings of `left`


class PacedClock:
    """`lost`: time let go so far [s]; `late`: ticks begun later than a period; `begun`: ticks."""

    def __init__(
        self,
        period: float,
        steady: Callable[[], float] = time.monotonic,
        system: Callable[[], float] = time.time,
        catch_up: float = CATCH_UP,
        latest: float = LATEST,
    ) -> None:
        """period [s] of a tick; steady, system: clocks [s]; catch_up [1]: fastest rate after a
        stall; latest [s]: lateness from which time is let go."""
        self._period, self._steady, self._system = period, steady, system
        self._shortest, self._latest = period / catch_up, latest
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

    def deadline(self, tick: int) -> float:
        """Return the steady time [s] at which `tick` may begin."""
        return max(self._origin + tick * self._period, self._newest + self._shortest)

    def left(self, tick: int) -> float:
        """Return the time [s] to sleep until `tick` may begin, 0 if it is due."""
        left = self.deadline(tick) - self._steady()
        return left if left > SHORTEST else 0.0

    def note(self, tick: int) -> None:
        """Note that `tick` begins now."""
        self._newest = now = self._steady()
        late = now - self._origin - tick * self._period
        self.begun += 1
        self.late += late > self._period
        if late > self._latest:
            self._origin += late
            self.lost += late


class Patience:
    """Time limit of `seconds` of wall time.

    A stopped virtual machine or a suspended laptop also stops the process that is waited for.
    Between two readings of `left` at most SLICE counts, so the wait continues after such a pause.
    """

    def __init__(self, seconds: float):
        self._left = seconds
        self._read = time.monotonic()

    @property
    def left(self) -> float:
        """Return the seconds left, at least 0. Read it more often than every SLICE."""
        now = time.monotonic()
        self._left = max(0.0, self._left - min(now - self._read, SLICE))
        self._read = now
        return self._left

    @property
    def over(self) -> bool:
        return self.left == 0.0
