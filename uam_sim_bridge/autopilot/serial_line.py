"""The stand-in's end of a serial line: for all messages, as on a flight controller in HITL mode, or
for those of the companion alone.

`SerialLine` replaces both the simulator's socket and the companion's UDP port in `Server`.
"""

from __future__ import annotations

import select

from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message
from uam_sim_bridge.mavlink.transport.serial_transport import SerialTransport
from uam_sim_bridge.mavlink.transport.transport import open_transport


class SerialLine:
    """One serial line; its loss ends the server, like a closed connection to the simulator."""

    def __init__(self, place: str, codec: Codec) -> None:
        """place: DEVICE:BAUD. Raises PortError in one line if it cannot be opened."""
        self._transport: SerialTransport = open_transport(f"serial:{place}")
        self._codec = codec
        self._chunks: list[bytes] = []

    def recv(self, size: int) -> bytes:
        """Wait for bytes and return them; b"" if the line is lost. `size`: not used, see socket."""
        while not self._chunks:
            if self._transport.losses or not self._transport.connected:
                return b""
            select.select([self._transport.fileno()], [], [])
            self._chunks = self._transport.receive()
        return self._chunks.pop(0)

    def sendall(self, frame: bytes) -> None:
        """Send a frame; it is lost if the line's buffer is full, as on a flight controller."""
        self._transport.send(frame)

    def receive(self) -> list[Message]:
        """Return no messages: those of the companion arrive through `recv`."""
        return []

    def send(self, messages: list[Message]) -> None:
        """Send the messages to the companion."""
        for message in messages:
            self.sendall(self._codec.encode(message))

    def close(self) -> None:
        """Close the device."""
        self._transport.close()


class CompanionLine:
    """A serial line to the companion alone, as TELEM2; in the place of the UDP port in `Server`.

    It outlives the loss of the line: the device is opened again.
    """

    def __init__(self, place: str, codec: Codec) -> None:
        """place: DEVICE:BAUD. Raises PortError in one line if it cannot be opened."""
        self._transport = open_transport(f"serial:{place}")
        self._codec, self._framer = codec, Framer(codec)

    def receive(self) -> list[Message]:
        """Return all received messages."""
        chunks = self._transport.receive()
        return [message for data in chunks for message in self._framer.stream(data)]

    def send(self, messages: list[Message]) -> None:
        """Send the messages; those that the line's buffer has no room for are lost."""
        for message in messages:
            self._transport.send(self._codec.encode(message))

    def close(self) -> None:
        """Close the device."""
        self._transport.close()
