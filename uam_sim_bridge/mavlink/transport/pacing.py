"""How much a line may carry: a budget that grows with time, and a meter of what it carries."""

from __future__ import annotations

BURST = 0.01  # s of the line's rate that may go out at once: what queues up in the device's buffer


class Pacer:
    """Bytes that may be sent now, so that they do not queue up where nothing overtakes them.

    Without a rate everything may go. All times [s] are of one clock, whichever.
    """

    def __init__(self, bytes_per_second: float | None, share: float = 1.0) -> None:
        """share: of the rate, which this sender may use."""
        self._rate = None if bytes_per_second is None else share * bytes_per_second
        self._credit = 0.0
        self._time: float | None = None

    def may_send(self, time: float) -> bool:
        """Whether a frame may go out at `time`; it may overdraw the budget."""
        if self._rate is None:
            return True
        elapsed = 0.0 if self._time is None else time - self._time
        self._time = time
        self._credit = min(self._credit + self._rate * elapsed, self._rate * BURST)
        return self._credit >= 0.0

    def sent(self, size: int) -> None:
        """Take `size` bytes off the budget."""
        self._credit -= size

    @property
    def wait(self) -> float:
        """Seconds until a frame may go out, as far as known at the last `may_send`."""
        return 0.0 if self._rate is None else max(0.0, -self._credit / self._rate)


class Meter:
    """Bytes per second over windows of a given length."""

    def __init__(self, window: float = 1.0) -> None:
        """window [s]."""
        self._window = window
        self._since: float | None = None
        self._bytes = 0
        self.rate = self.highest = 0.0

    def add(self, size: int) -> None:
        """Count `size` bytes."""
        self._bytes += size

    def update(self, time: float) -> bool:
        """Close the window at `time` [s] if it is over; whether `rate` [bytes/s] is a new one."""
        if self._since is None:
            self._since = time
        elapsed = time - self._since
        if elapsed < self._window:
            return False
        self.rate = self._bytes / elapsed
        self.highest = max(self.highest, self.rate)
        self._since, self._bytes = time, 0
        return True
