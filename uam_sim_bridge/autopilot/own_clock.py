"""The stand-in's clock on a serial line: its own, as that of a flight controller in HITL mode.

Samples of a simulator come early and late. Their times in the autopilot's clock keep the
simulator's even spacing, and stay within WITHIN of the own clock: a simulator that stalls does not
stop the autopilot's clock, which the companion would take for a reboot.
"""

from __future__ import annotations

import time
from collections.abc import Callable

WITHIN = 0.02  # [s] between the time of a sample and the own clock
FOLLOW = 0.002  # [1] part of the difference by which the times follow, per sample
LEAST = 0.0005  # [s] between two samples


class OwnClock:
    """Converts the simulator's times [s] into the autopilot's, 0 at the first sample."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """clock: own clock [s]."""
        self._clock = clock
        self._start: float | None = None
        self._offset = self._last = 0.0

    def time(self, simulated: float) -> float:
        """Return the time [s] of a sample that arrives now; later than that of the one before."""
        if self._start is None:
            self._start, self._offset = self._clock(), -simulated
            return 0.0
        now = self._clock() - self._start
        late = now - (simulated + self._offset)
        self._offset += FOLLOW * late
        if abs(late) > WITHIN:
            self._offset += late - (WITHIN if late > 0.0 else -WITHIN)
        self._last = max(self._last + LEAST, simulated + self._offset)
        return self._last
