"""When the ticks of a realtime flight begin, by the wall clock."""

from __future__ import annotations

CATCH_UP = 1.25  # [1] largest real-time factor after a stall of the machine


class TickDeadlines:
    """Ticks begin one period apart. After a stall they come faster, but not in a burst: the other
    nodes could not follow. `lost` [s]: time let go so far.
    """

    def __init__(self, period: float, let_go: float) -> None:
        """period [s] of a tick; let_go [s]: lateness from which time is let go, 0: never."""
        self._period, self._let_go = period, let_go
        self.lost = 0.0

    def next(self, begin: float, ticks: int, begun: float, now: float) -> float:
        """Return the wall time [s] at which the next tick begins.

        begin [s]: of the flight; ticks: from there to the next one; begun [s]: of this tick;
        now [s].
        """
        due = begin + self.lost + ticks * self._period
        if self._let_go and now - due > self._let_go:
            self.lost += now - due
            due = now
        return max(due, begun + self._period / CATCH_UP)
