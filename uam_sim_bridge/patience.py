"""Time limit of a wait that does not count pauses of the machine (suspend, stopped VM)."""

from __future__ import annotations

import time

SLICE = 0.5  # s, most that counts between two readings of `left`


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
        """Return whether no time is left."""
        return self.left == 0.0
