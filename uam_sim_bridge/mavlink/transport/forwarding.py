"""A ground station beside the bridge: it hears all that the autopilot sends, and may speak to it.

`GroundStation` stands between `OffboardLink` and the autopilot's transport, which notices nothing.
To the station go the bytes as they came. From it go whole valid messages only, a bounded number of
bytes at each tick and, on a line of known speed, a bounded share of it. They pass by the link:
whatever a station says, it is not the autopilot's word.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer
from uam_sim_bridge.mavlink.transport.pacing import Pacer
from uam_sim_bridge.mavlink.transport.transport import Transport, open_transport
from uam_sim_bridge.ports import PortError

BYTES_PER_TICK = 2048  # read from the station, hence forwarded at most
DATAGRAM = 1400  # bytes to the station at once: what passes any network in one piece
LINE_SHARE = 0.2  # of a line of known speed: the setpoints come first


class GroundStation:
    """A transport around the autopilot's; `forwarded` and `held_back` count messages to it."""

    def __init__(
        self,
        url: str,
        autopilot: Transport,
        codec: Codec,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """url: udp:HOST:PORT; codec: decides what a valid message is; clock [s] of wall time.

        Raises PortError in one line for another kind of URL.
        """
        if not url.startswith("udp:"):
            raise PortError(f"ground station {url!r}: udp:HOST:PORT[:LOCAL_PORT] expected")
        self._station = open_transport(url, BYTES_PER_TICK)
        self._autopilot = autopilot
        self._framer = Framer(codec)
        self._pacer = Pacer(autopilot.bytes_per_second, LINE_SHARE)
        self._clock = clock
        self.stream = autopilot.stream
        self.bytes_per_second = autopilot.bytes_per_second
        self.forwarded = self.held_back = 0

    @property
    def connected(self) -> bool:
        """Whether the autopilot's link is open."""
        return self._autopilot.connected

    @property
    def dropped(self) -> int:
        """What could not be sent to the autopilot."""
        return self._autopilot.dropped

    def send(self, data: bytes) -> bool:
        """Send to the autopilot."""
        return self._autopilot.send(data)

    def receive(self) -> list[bytes]:
        """Return what the autopilot sent; the station gets it too."""
        chunks = self._autopilot.receive()
        for chunk in chunks:
            for at in range(0, len(chunk), DATAGRAM):
                self._station.send(chunk[at : at + DATAGRAM])
        return chunks

    def forward(self) -> None:
        """Send the autopilot what the station said; to be called after the setpoint is out."""
        for data in self._station.receive():
            for message in self._framer.datagram(data):
                frame = bytes(message.get_msgbuf())
                if self._pacer.may_send(self._clock()) and self._autopilot.send(frame):
                    self._pacer.sent(len(frame))
                    self.forwarded += 1
                else:
                    self.held_back += 1

    def fileno(self) -> int:
        """Return the descriptor of the autopilot's link."""
        return self._autopilot.fileno()

    def close(self) -> None:
        """Close both."""
        self._autopilot.close()
        self._station.close()
