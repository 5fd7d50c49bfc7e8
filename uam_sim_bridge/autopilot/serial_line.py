"""The stand-in's end of a serial line that carries everything, as at a flight controller in HITL.

It takes the places of both the simulator's socket and the companion's UDP port in `Server`.
"""

from __future__ import annotations

import select

from uam_sim_bridge.mavlink.protocol.wire import Codec, Message
from uam_sim_bridge.mavlink.transport.serial_transport import SerialTransport
from uam_sim_bridge.mavlink.transport.transport import open_transport


class SerialLine:
    """One line; its loss ends the server, as the end of the simulator's connection does."""

    def __init__(self, place: str, codec: Codec) -> None:
        """place: DEVICE:BAUD. Raises PortError in one line where it cannot be opened."""
        self._transport: SerialTransport = open_transport(f"serial:{place}")
        self._codec = codec
        self._chunks: list[bytes] = []

    def recv(self, size: int) -> bytes:
        """Wait for bytes and return them; b"" once the line is lost. `size` is the socket's."""
        while not self._chunks:
            if self._transport.losses or not self._transport.connected:
                return b""
            select.select([self._transport.fileno()], [], [])
            self._chunks = self._transport.receive()
        return self._chunks.pop(0)

    def sendall(self, frame: bytes) -> None:
        """Send a frame; one that a full line does not take is lost, as at a flight controller."""
        self._transport.send(frame)

    def receive(self) -> list[Message]:
        """Return nothing: messages of the companion come in the stream."""
        return []

    def send(self, messages: list[Message]) -> None:
        """Send the messages to the companion."""
        for message in messages:
            self.sendall(self._codec.encode(message))

    def close(self) -> None:
        """Give the device back."""
        self._transport.close()
