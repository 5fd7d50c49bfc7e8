"""When the next cycle of the bus begins."""

from __future__ import annotations

import time
from collections.abc import Callable

BACKLOG = 0.02  # [s] made up for; time lost in a longer stall is let go


class CyclePace:
    """Absolute deadlines at a rate.

    Single late cycles do not lower the rate: those after them follow without a pause until they are
    on time again. After a longer stall there is no burst.
    """

    def __init__(
        self,
        rate: float,
        clock: Callable[[], float] = time.monotonic,
        backlog: float = BACKLOG,
    ) -> None:
        """rate [Hz]; clock: seconds; backlog [s]: lateness that is made up for."""
        self._period, self._clock, self._backlog = 1.0 / rate, clock, backlog
        self._due = clock()

    def left(self) -> float:
        """Return the time [s] to sleep until the next cycle, 0 if it is due; once a cycle."""
        self._due += self._period
        left = self._due - self._clock()
        if left < -self._backlog:
            self._due -= left
        return max(left, 0.0)
