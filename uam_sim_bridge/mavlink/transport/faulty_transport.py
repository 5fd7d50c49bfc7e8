"""A MAVLink connection with faults, around a good one."""

from __future__ import annotations

from collections import deque

import numpy as np

from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.link_faults import LinkFault, MavlinkCorruption, MavlinkCut, MavlinkDelay
from uam_sim_bridge.faults.timeline import Happened, Timeline
from uam_sim_bridge.mavlink.transport.transport import Transport


class FaultyTransport:
    """A transport that loses, delays and corrupts what passes it, as a schedule says.

    It has no clock: `mission_at` and `update` tell it the time. What is lost counts as sent, as
    the sender cannot know.
    """

    def __init__(self, inner: Transport, schedule: Schedule) -> None:
        """inner: the good one, closed with this; schedule: faults of the link alone."""
        self._inner = inner
        self._timeline = Timeline(schedule)
        self._noise = np.random.default_rng(np.random.SeedSequence(schedule.seed, spawn_key=(1,)))
        self._now = 0.0
        self._going: deque[tuple[float, bytes]] = deque()
        self._coming: deque[tuple[float, bytes]] = deque()
        self.stream = inner.stream
        self.bytes_per_second = inner.bytes_per_second

    @property
    def connected(self) -> bool:
        """Whether the link is open."""
        return self._inner.connected

    @property
    def dropped(self) -> int:
        """What could not be sent, apart from what the faults took."""
        return self._inner.dropped

    def mission_at(self, stamp: float, time: float) -> None:
        """See `Timeline.mission_at`."""
        self._timeline.mission_at(stamp, time)

    def update(self, stamp: float) -> list[Happened]:
        """It is now `stamp` [s]: what was late goes out; returns faults that came or went."""
        self._now = max(self._now, stamp)
        changed = self._timeline.update(stamp)
        for data in self._due(self._going):
            self._inner.send(data)
        return changed

    def send(self, data: bytes) -> bool:
        """Send to the autopilot, unless a fault has it."""
        altered = self._altered(data, [f for f in self._active if f.outwards])
        if altered is None:
            return True
        late, altered = altered
        if late or self._going:
            self._going.append((self._now + late, altered))
            return True
        return self._inner.send(altered)

    def receive(self) -> list[bytes]:
        """Return what arrives from the autopilot."""
        faults = [f for f in self._active if f.inwards]
        for data in self._inner.receive():
            altered = self._altered(data, faults)
            if altered is not None:
                late, altered = altered
                self._coming.append((self._now + late, altered))
        return self._due(self._coming)

    def fileno(self) -> int:
        """Return the descriptor of the link."""
        return self._inner.fileno()

    def close(self) -> None:
        """Close the link."""
        self._inner.close()

    @property
    def _active(self) -> list[LinkFault]:
        return [one.fault for one in self._timeline.all if one.active]

    def _altered(self, data: bytes, faults: list[LinkFault]) -> tuple[float, bytes] | None:
        """By how much it is late [s], and what is left of it; None: lost."""
        late = 0.0
        for fault in faults:
            if isinstance(fault, MavlinkCut):
                return None
            if isinstance(fault, MavlinkDelay):
                late += fault.delay
            if isinstance(fault, MavlinkCorruption) and self._noise.random() < fault.share:
                spoiled = bytearray(data)
                spoiled[self._noise.integers(len(spoiled))] ^= int(self._noise.integers(1, 256))
                data = bytes(spoiled)
        return late, data

    def _due(self, queue: deque[tuple[float, bytes]]) -> list[bytes]:
        """Take what is due; in order, so nothing overtakes what is late."""
        found = []
        while queue and queue[0][0] <= self._now + 1e-9:
            found.append(queue.popleft()[1])
        return found
