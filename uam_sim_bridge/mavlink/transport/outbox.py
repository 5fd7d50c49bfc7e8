"""Send queue for a slow line: urgent frames first, oldest frames dropped, whole frames only."""

from __future__ import annotations

from collections import deque

from uam_sim_bridge.mavlink.transport.pacing import Pacer
from uam_sim_bridge.mavlink.transport.transport import Transport

URGENT = frozenset({"HIL_SENSOR", "HIL_GPS", "SET_ATTITUDE_TARGET"})
URGENT_KEPT, OTHERS_KEPT = 8, 64  # frames, queue lengths; old sensor data and setpoints are useless


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
