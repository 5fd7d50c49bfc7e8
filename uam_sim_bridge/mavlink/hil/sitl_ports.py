"""The autopilot's ends of PX4 SITL's ports: UDP to the companion computer, TCP to the simulator."""

from __future__ import annotations

import socket
import time as clock

from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message
from uam_sim_bridge.ports import PortError

HOST = "127.0.0.1"


class UdpPort:
    """The companion side: answers only the first peer that sends a valid message, as PX4 does."""

    def __init__(self, local: int, remote: int, codec: Codec) -> None:
        """local: port to listen on; remote: port told unasked until a peer has spoken.

        Raises PortError where the port is taken.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((HOST, local))
        except OSError as error:
            self._socket.close()
            raise PortError(
                f"UDP port {local} for the companion computer: {error.strerror}; "
                "choose another instance or --mavlink-port"
            ) from None
        self._socket.setblocking(False)
        self._codec = codec
        self._framer = Framer(codec)
        self._peer = (HOST, remote)
        self._locked = False

    def receive(self) -> list[Message]:
        """Return all messages that have arrived."""
        messages: list[Message] = []
        while True:
            try:
                data, sender = self._socket.recvfrom(65535)
            except BlockingIOError:
                return messages
            except ConnectionError:  # the peer's port was closed when we sent last
                continue
            if self._locked and sender != self._peer:
                continue
            new = self._framer.datagram(data)
            if new:
                self._peer, self._locked = sender, True
            messages += new

    def send(self, messages: list[Message]) -> None:
        """Send each message in a datagram of its own; nobody listening is no error."""
        for message in messages:
            self.send_frame(self._codec.encode(message))

    def send_frame(self, frame: bytes) -> None:
        """Send one packed message as it is."""
        try:
            self._socket.sendto(frame, self._peer)
        except (BlockingIOError, ConnectionError):
            pass

    def fileno(self) -> int:
        """Return the socket's number, for select."""
        return self._socket.fileno()

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


def connect(name: str, host: str, port: int, patience: float) -> socket.socket:
    """Return the link to the simulator, waiting up to `patience` seconds for it to listen.

    name: of the program, for what it says meanwhile. Raises PortError when it does not.
    """
    end = clock.monotonic() + patience
    said = False
    while True:
        try:
            link = socket.create_connection((host, port), timeout=max(0.1, patience))
            break
        except socket.gaierror as error:
            raise PortError(f"simulator host {host}: {error.strerror}") from None
        except OSError as error:
            if clock.monotonic() > end:
                raise PortError(
                    f"no simulator at {host}:{port} within {patience:g} s "
                    f"({error.strerror or 'no answer'})"
                ) from None
            if not said:
                print(f"{name}: waiting for the simulator at {host}:{port}", flush=True)
                said = True
            clock.sleep(0.05)
    link.settimeout(None)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return link
