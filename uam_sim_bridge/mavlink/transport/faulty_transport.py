"""Transports of a simulated network: late to the autopilot, or with faults of the link."""

from __future__ import annotations

from collections import deque

import numpy as np

from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.link_faults import LinkFault, MavlinkCorruption, MavlinkCut, MavlinkDelay
from uam_sim_bridge.faults.timeline import FaultState, Timeline
from uam_sim_bridge.mavlink.transport.transport import Transport, WrappedTransport
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay


class FaultyTransport(WrappedTransport):
    """Wraps a transport; loses, delays and corrupts packets at the times of a schedule.

    It has no clock: `mission_at` and `update` pass the time. `send` returns True also for a packet
    that a fault loses: a real sender does not detect the loss.
    """

    def __init__(self, inner: Transport, schedule: Schedule) -> None:
        """inner: wrapped transport, closed together with this one; schedule: link faults only."""
        super().__init__(inner)
        self._timeline = Timeline(schedule)
        self._noise = np.random.default_rng(np.random.SeedSequence(schedule.seed, spawn_key=(1,)))
        self._now = 0.0
        self._outgoing: deque[tuple[float, bytes]] = deque()
        self._incoming: deque[tuple[float, bytes]] = deque()

    def mission_at(self, stamp: float, time: float, phase: str) -> None:
        """See `Timeline.mission_at`."""
        self._timeline.mission_at(stamp, time, phase)

    def update(self, stamp: float) -> list[FaultState]:
        """Set the time to `stamp` [s], send delayed packets; return faults that began or ended."""
        self._now = max(self._now, stamp)
        changed = self._timeline.update(stamp)
        for data in self._due(self._outgoing):
            self.inner.send(data)
        return changed

    def send(self, data: bytes) -> bool:
        """Send to the autopilot; active faults lose, delay or corrupt the packet."""
        altered = self._altered(data, [f for f in self._active if f.outwards])
        if altered is None:
            return True
        late, altered = altered
        if late or self._outgoing:
            self._outgoing.append((self._now + late, altered))
            return True
        return self.inner.send(altered)

    def receive(self) -> list[bytes]:
        """Return the packets received from the autopilot; active faults apply."""
        faults = [f for f in self._active if f.inwards]
        for data in self.inner.receive():
            altered = self._altered(data, faults)
            if altered is not None:
                late, altered = altered
                self._incoming.append((self._now + late, altered))
        return self._due(self._incoming)

    @property
    def _active(self) -> list[LinkFault]:
        return [one.fault for one in self._timeline.all if one.active]

    def _altered(self, data: bytes, faults: list[LinkFault]) -> tuple[float, bytes] | None:
        """Return delay [s] and the (corrupted) packet; None if it is lost."""
        late = 0.0
        for fault in faults:
            if isinstance(fault, MavlinkCut):
                return None
            if isinstance(fault, MavlinkDelay):
                late += fault.late(self._noise)
            if isinstance(fault, MavlinkCorruption) and self._noise.random() < fault.share:
                corrupted = bytearray(data)
                corrupted[self._noise.integers(len(corrupted))] ^= int(self._noise.integers(1, 256))
                data = bytes(corrupted)
        return late, data

    def _due(self, queue: deque[tuple[float, bytes]]) -> list[bytes]:
        """Remove and return the packets that are due, in order: no packet overtakes another."""
        found = []
        while queue and queue[0][0] <= self._now + 1e-9:
            found.append(queue.popleft()[1])
        return found


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
