"""What waits for a slow line: urgent frames first, old ones dropped, whole frames only."""

from __future__ import annotations

from collections import deque

from uam_sim_bridge.mavlink.transport.pacing import Pacer
from uam_sim_bridge.mavlink.transport.transport import Transport

URGENT = frozenset({"HIL_SENSOR", "HIL_GPS", "SET_ATTITUDE_TARGET"})
URGENT_KEPT, OTHERS_KEPT = 8, 64  # frames; of urgent ones an old one is of no use


class Outbox:
    """Two queues before a transport; `dropped` counts frames that found no place."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._pacer = Pacer(transport.bytes_per_second)
        self._urgent: deque[bytes] = deque()
        self._others: deque[bytes] = deque()
        self.dropped = 0

    def put(self, kind: str, frame: bytes) -> None:
        """Queue a frame whose message is called `kind`."""
        queue, kept = (self._urgent, URGENT_KEPT) if kind in URGENT else (self._others, OTHERS_KEPT)
        if len(queue) >= kept:
            queue.popleft()
            self.dropped += 1
        queue.append(frame)

    def flush(self, time: float) -> int:
        """Send what the line takes at `time` [s]; return how many bytes that were."""
        sent = 0
        while (queue := self._urgent or self._others) and self._pacer.may_send(time):
            if not self._transport.send(queue[0]):
                if not (self._transport.stream and self._transport.connected):
                    self.clear()  # the line is gone; otherwise it is full, and what waits waits
                break
            self._pacer.sent(len(queue[0]))
            sent += len(queue.popleft())
        return sent

    def clear(self) -> None:
        """Forget what waits: the line is gone, and it would be old when it comes back."""
        self.dropped += len(self._urgent) + len(self._others)
        self._urgent.clear()
        self._others.clear()

    @property
    def wait(self) -> float | None:
        """Seconds until `flush` is worth a call, None while nothing waits."""
        return self._pacer.wait if self._urgent or self._others else None
