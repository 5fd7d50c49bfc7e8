"""How long something is waited for, on a machine that may itself stand still for a while."""

from __future__ import annotations

import time

SLICE = 0.5  # [s] the most that one look may use up


class Patience:
    """Runs out after `seconds` of wall time in which this process has looked.

    A virtual machine that was stopped for a minute, a laptop that was closed: whoever is waited for
    stood still as well, and the first look afterwards must not give up on him.
    """

    def __init__(self, seconds: float):
        self._left = seconds
        self._looked = time.monotonic()

    @property
    def left(self) -> float:
        """Seconds left, never negative. To be looked at more often than every SLICE."""
        now = time.monotonic()
        self._left = max(0.0, self._left - min(now - self._looked, SLICE))
        self._looked = now
        return self._left

    @property
    def over(self) -> bool:
        """Whether it has run out."""
        return self.left == 0.0
