"""Link statistics: received messages per second; lost messages from gaps in sequence numbers."""

from __future__ import annotations

import math

PERIOD = 1.0  # s, window of the rate


class LinkStatistics:
    """Counts received messages. `rate` [1/s]: over the last second; `received`: in total."""

    def __init__(self) -> None:
        self.rate = 0.0
        self.received = 0
        self._gaps = 0
        self._sequences: dict[int, int] = {}  # component → its last sequence number
        self._at, self._before = -math.inf, 0

    def count(self, component: int, sequence: int) -> None:
        """Count a message of one component of the autopilot's system."""
        self.received += 1
        last = self._sequences.get(component)
        self._sequences[component] = sequence
        if last is not None:
            gap = (sequence - last - 1) % 256
            if gap < 128:  # larger: messages arrived out of order
                self._gaps += gap

    def lost(self, unread: int) -> int:
        """Return the number of lost messages; unread: messages received but not counted here."""
        return max(0, self._gaps - unread)

    def restart(self) -> None:
        """Accept any next sequence number: after a reboot a jump is no loss."""
        self._sequences.clear()

    def tick(self, time: float) -> None:
        """Update `rate` at the tick `time` [s]."""
        since = time - self._at
        if since < PERIOD:
            return
        if math.isfinite(since):
            self.rate = (self.received - self._before) / since
        self._at, self._before = time, self.received
