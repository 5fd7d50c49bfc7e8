"""A transport of a simulated network: packets to the autopilot arrive later."""

from __future__ import annotations

from collections import deque

from uam_sim_bridge.mavlink.transport.transport import Transport, WrappedTransport
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay


class LateTransport(WrappedTransport):
    """Wraps a transport; packets to the autopilot are sent after the delay of their tick, in order.

    It has no clock: `update` passes the time. `send` returns True also for a packet that waits.
    """

    def __init__(self, inner: Transport, delay: SetpointDelay) -> None:
        """inner: wrapped transport, closed together with this one."""
        super().__init__(inner)
        self._delay, self._now = delay, 0.0
        self._waiting: deque[tuple[float, bytes]] = deque()

    def update(self, stamp: float) -> None:
        """Begin the tick `stamp` [s]: send the packets that are due."""
        self._now = stamp
        while self._waiting and self._waiting[0][0] <= stamp + 1e-9:
            self.inner.send(self._waiting.popleft()[1])

    def send(self, data: bytes) -> bool:
        """Send to the autopilot when the packet is due."""
        late = self._delay.at(self._now)
        if not late and not self._waiting:
            return self.inner.send(data)
        self._waiting.append((self._now + late, data))
        return True
