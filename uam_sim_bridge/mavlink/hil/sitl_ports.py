"""The autopilot's ports as in PX4 SITL: UDP to the companion computer, TCP to the simulator."""

from __future__ import annotations

import socket
import time as clock

from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message
from uam_sim_bridge.patience import Patience
from uam_sim_bridge.ports import PortError

HOST = "127.0.0.1"
SILENT = 5.0  # [s]; does not count while the simulation stands still


class UdpPort:
    """UDP to the companion computer; like PX4, answers only the first peer with a valid message.

    After SILENT without a message of this peer the next one with a valid message takes its place.
    """

    def __init__(self, local: int, remote: int, codec: Codec) -> None:
        """local: port to listen on; remote: destination until the first peer sends a message.

        Raises PortError if the local port is in use.
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
        self._silence: Patience | None = None  # of the peer; None: before the first message

    def receive(self) -> list[Message]:
        """Return all received messages."""
        messages: list[Message] = []
        silent = self._silence is None or self._silence.over
        while True:
            try:
                data, sender = self._socket.recvfrom(65535)
            except BlockingIOError:
                return messages
            except ConnectionError:  # the peer's port was closed at the last send
                continue
            if not silent and sender != self._peer:
                continue
            new = self._framer.datagram(data)
            if new:
                self._peer, self._silence, silent = sender, Patience(SILENT), False
            messages += new

    def send(self, messages: list[Message]) -> None:
        """Send each message in its own datagram; a closed port of the peer is no error."""
        for message in messages:
            self.send_frame(self._codec.encode(message))

    def send_frame(self, frame: bytes) -> None:
        """Send one encoded message unchanged."""
        try:
            self._socket.sendto(frame, self._peer)
        except (BlockingIOError, ConnectionError):
            pass

    def fileno(self) -> int:
        """Return the socket's file descriptor, for select."""
        return self._socket.fileno()

    def close(self) -> None:
        """Release the port."""
        self._socket.close()


def connect(name: str, host: str, port: int, patience: float) -> socket.socket:
    """Return a TCP connection to the simulator; waits up to `patience` [s] for its port to open.

    name: program name in the printed line. Raises PortError after this time.
    """
    end = clock.monotonic() + patience
    printed = False
    while True:
        try:
            link = socket.create_connection((host, port), timeout=min(max(0.1, patience), 60.0))
            break
        except socket.gaierror as error:
            raise PortError(f"simulator host {host}: {error.strerror}") from None
        except OSError as error:
            if clock.monotonic() > end:
                raise PortError(
                    f"no simulator at {host}:{port} within {patience:g} s "
                    f"({error.strerror or 'no answer'})"
                ) from None
            if not printed:
                print(f"{name}: waiting for the simulator at {host}:{port}", flush=True)
                printed = True
            clock.sleep(0.05)
    link.settimeout(None)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return link
