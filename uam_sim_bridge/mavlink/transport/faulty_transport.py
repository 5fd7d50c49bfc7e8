"""Transports around another one: late and with faults of the link, or a ground station beside.

`GroundStation` wraps the autopilot's transport for `OffboardLink`. It forwards the autopilot's
bytes unchanged to the station. From the station it forwards only whole valid messages, with a
limit of bytes per tick and, on a line of known rate, a limited share of this rate. `OffboardLink`
does not receive the station's messages, so they cannot change the autopilot's state in the bridge.
"""

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.link_faults import LinkFault
from uam_sim_bridge.faults.timeline import FaultState, Timeline
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer
from uam_sim_bridge.mavlink.transport.pacing import Pacer
from uam_sim_bridge.mavlink.transport.transport import Transport, open_transport
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay
from uam_sim_bridge.ports import PortError

BYTES_PER_TICK = 2048  # limit of bytes read from the station per tick
DATAGRAM = 1400  # bytes, largest datagram to the station: below the usual network MTU
LINE_SHARE = 0.2  # of the line's rate; the rest is for setpoints


class WrappedTransport:
    """Base of transports around another one, `inner`; what a class does not change is `inner`'s."""

    def __init__(self, inner: Transport) -> None:
        self.inner = inner

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)


class FaultyTransport(WrappedTransport):
    """Wraps a transport; loses, delays and corrupts packets at the times of a schedule.

    It has no clock: `update` passes the time. `timeline`: of the faults, needs that of the mission.
    `send` returns True also for a packet that waits, or that a fault loses: a real sender does not
    detect the loss.
    """

    def __init__(
        self, inner: Transport, schedule: Schedule, network: SetpointDelay | None = None
    ) -> None:
        """inner: wrapped transport, closed together with this one; schedule: link faults only;
        network: further delay of the packets to the autopilot."""
        super().__init__(inner)
        self.timeline, self._network = Timeline(schedule), network
        self._noise = np.random.default_rng(np.random.SeedSequence(schedule.seed, spawn_key=(1,)))
        self._now = 0.0
        self._outgoing: deque[tuple[float, bytes]] = deque()
        self._incoming: deque[tuple[float, bytes]] = deque()

    def update(self, stamp: float) -> list[FaultState]:
        """Set the time to `stamp` [s], send what is due; return the faults that began or ended."""
        self._now = max(self._now, stamp)
        for data in self._due(self._outgoing):
            self.inner.send(data)
        return self.timeline.update(stamp)

    def send(self, data: bytes) -> bool:
        """Send to the autopilot; active faults lose, delay or corrupt the packet."""
        altered = self._altered(data, [f for f in self.timeline.active if f.outwards])
        if altered is None:
            return True
        data, late = altered
        late += 0.0 if self._network is None else self._network.at(self._now)
        if not late and not self._outgoing:
            return self.inner.send(data)
        self._outgoing.append((self._now + late, data))
        return True

    def receive(self) -> list[bytes]:
        """Return the packets received from the autopilot; active faults apply."""
        faults = [f for f in self.timeline.active if f.inwards]
        for packet in self.inner.receive():
            altered = self._altered(packet, faults)
            if altered is not None:
                data, late = altered
                self._incoming.append((self._now + late, data))
        return self._due(self._incoming)

    def _altered(self, data: bytes, faults: list[LinkFault]) -> tuple[bytes, float] | None:
        """Return the packet as it arrives and its delay [s]; None if it is lost."""
        late = 0.0
        for fault in faults:
            late += fault.late(self._noise)
            arriving = fault.arriving(data, self._noise)
            if arriving is None:
                return None
            data = arriving
        return data, late

    def _due(self, queue: deque[tuple[float, bytes]]) -> list[bytes]:
        """Remove and return the packets that are due, in order: no packet overtakes another."""
        found = []
        while queue and queue[0][0] <= self._now + 1e-9:
            found.append(queue.popleft()[1])
        return found


class GroundStation(WrappedTransport):
    """Transport with forwarding; `forwarded`, `held_back`: messages from the station, counted."""

    def __init__(
        self,
        url: str,
        autopilot: Transport,
        codec: Codec,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """url: udp:HOST:PORT; codec: validates the station's messages; clock: wall time [s].

        Raises PortError in one line for another kind of URL.
        """
        if not url.startswith("udp:"):
            raise PortError(f"ground station {url!r}: udp:HOST:PORT[:LOCAL_PORT] expected")
        super().__init__(autopilot)
        self._station = open_transport(url, BYTES_PER_TICK)
        self._framer = Framer(codec)
        self._pacer = Pacer(autopilot.bytes_per_second, LINE_SHARE)
        self._clock = clock
        self.forwarded = self.held_back = 0

    def receive(self) -> list[bytes]:
        """Return the bytes received from the autopilot; forward them to the station."""
        chunks = self.inner.receive()
        for chunk in chunks:
            for at in range(0, len(chunk), DATAGRAM):
                self._station.send(chunk[at : at + DATAGRAM])
        return chunks

    def forward(self) -> None:
        """Forward the station's messages to the autopilot; call after the setpoint is sent."""
        for data in self._station.receive():
            for message in self._framer.datagram(data):
                frame = bytes(message.get_msgbuf())
                if self._pacer.may_send(self._clock()) and self.inner.send(frame):
                    self._pacer.sent(len(frame))
                    self.forwarded += 1
                else:
                    self.held_back += 1

    def close(self) -> None:
        self.inner.close()
        self._station.close()
