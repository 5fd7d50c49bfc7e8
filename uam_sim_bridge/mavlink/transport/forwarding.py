"""Forwards MAVLink between the autopilot and a ground station beside the bridge.

`GroundStation` wraps the autopilot's transport for `OffboardLink`. It forwards the autopilot's
bytes unchanged to the station. From the station it forwards only whole valid messages, with a
limit of bytes per tick and, on a line of known rate, a limited share of this rate. `OffboardLink`
does not receive the station's messages, so they cannot change the autopilot's state in the bridge.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer
from uam_sim_bridge.mavlink.transport.pacing import Pacer
from uam_sim_bridge.mavlink.transport.transport import Transport, WrappedTransport, open_transport
from uam_sim_bridge.ports import PortError

BYTES_PER_TICK = 2048  # limit of bytes read from the station per tick
DATAGRAM = 1400  # bytes, largest datagram to the station: below the usual network MTU
LINE_SHARE = 0.2  # of the line's rate; the rest is for setpoints


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
        """Close both links."""
        super().close()
        self._station.close()
