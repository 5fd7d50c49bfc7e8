"""A line that is slower than what is sent: rate limit (token bucket), rate meter, and outbox."""

from collections import deque

from uam_sim_bridge.mavlink.transport.transport import Transport

BURST = 0.01  # s of the line's rate, largest burst: it waits in the device's buffer
URGENT = frozenset({"HIL_SENSOR", "HIL_GPS", "SET_ATTITUDE_TARGET"})
URGENT_KEPT, OTHERS_KEPT = 8, 64  # frames, queue lengths; old sensor data and setpoints are useless


class Pacer:
    """Token bucket. It keeps the device's buffer short: urgent frames cannot overtake there.

    Without a rate there is no limit. All times [s] must be of one clock.
    """

    def __init__(self, bytes_per_second: float | None, share: float = 1.0) -> None:
        """bytes_per_second: rate of the line, None: unlimited; share: 0..1, of this sender."""
        self._rate = None if bytes_per_second is None else share * bytes_per_second
        self._credit = 0.0
        self._time: float | None = None

    def may_send(self, time: float) -> bool:
        """Return whether a frame may be sent at `time` [s]; it may overdraw the budget."""
        if self._rate is None:
            return True
        elapsed = 0.0 if self._time is None else time - self._time
        self._time = time
        self._credit = min(self._credit + self._rate * elapsed, self._rate * BURST)
        return self._credit >= 0.0

    def sent(self, size: int) -> None:
        """Subtract `size` bytes from the budget."""
        self._credit -= size

    @property
    def wait(self) -> float:
        """Return the seconds until a frame may be sent, as of the last `may_send`."""
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
        """End the window at `time` [s] if it is over; return whether `rate` [bytes/s] is new."""
        if self._since is None:
            self._since = time
        elapsed = time - self._since
        if elapsed < self._window:
            return False
        self.rate = self._bytes / elapsed
        self.highest = max(self.highest, self.rate)
        self._since, self._bytes = time, 0
        return True


class Outbox:
    """Two queues before a transport, urgent and other; `dropped` counts discarded frames."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._pacer = Pacer(transport.bytes_per_second)
        self._urgent: deque[bytes] = deque()
        self._others: deque[bytes] = deque()
        self.dropped = 0

    def put(self, kind: str, frame: bytes) -> None:
        """Queue a frame; kind: name of its message. A full queue drops its oldest frame."""
        queue, kept = (self._urgent, URGENT_KEPT) if kind in URGENT else (self._others, OTHERS_KEPT)
        if len(queue) >= kept:
            queue.popleft()
            self.dropped += 1
        queue.append(frame)

    def flush(self, time: float) -> int:
        """Send what the line accepts at `time` [s]; return the number of bytes."""
        sent = 0
        while (queue := self._urgent or self._others) and self._pacer.may_send(time):
            if not self._transport.send(queue[0]):
                if not (self._transport.stream and self._transport.connected):
                    self.clear()  # the line is lost; a full line keeps its queue
                break
            self._pacer.sent(len(queue[0]))
            sent += len(queue.popleft())
        return sent

    def clear(self) -> None:
        """Drop all queued frames: they would be outdated after a reconnection."""
        self.dropped += len(self._urgent) + len(self._others)
        self._urgent.clear()
        self._others.clear()

    @property
    def wait(self) -> float | None:
        """Return the seconds until the next `flush`; None while the queues are empty."""
        return self._pacer.wait if self._urgent or self._others else None
