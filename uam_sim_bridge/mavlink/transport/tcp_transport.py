"""MAVLink over TCP, as a client."""

from __future__ import annotations

import errno
import os
import select
import socket
import time
from collections.abc import Callable

from uam_sim_bridge.mavlink.transport.stream_transport import CHUNK, StreamTransport
from uam_sim_bridge.mavlink.transport.udp_transport import resolve

CONNECT_PATIENCE = 3.0  # s, time limit of one attempt to connect
# ms without an acknowledgement after which the link is lost: setpoints must not arrive much later
SILENT_PEER = 1500


class TcpTransport(StreamTransport):
    """TCP client; connects later if the server is not listening yet, and again after a loss."""

    def __init__(
        self, remote: tuple[str, int], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """remote: host, port. Raises PortError for an unknown host; a closed port is no error."""
        super().__init__(clock)
        self._remote = (resolve(remote[0]), remote[1])  # at start-up: DNS may take seconds
        self._socket: socket.socket | None = None
        self._until = 0.0
        self._ready()

    def _open(self, now: float) -> bool:
        if self._socket is None:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, SILENT_PEER)
            self._until = now + CONNECT_PATIENCE
            code = self._socket.connect_ex(self._remote)
            if code not in (0, errno.EINPROGRESS):
                raise OSError(code, os.strerror(code))
        if not select.select([], [self._socket], [], 0.0)[1]:
            if now > self._until:
                raise TimeoutError
            return False
        code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise OSError(code, os.strerror(code))
        if self._socket.getsockname() == self._socket.getpeername():
            raise ConnectionRefusedError  # no server: on loopback the socket connected to itself
        return True

    def _read(self) -> bytes:
        try:
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError
        return data

    def _write(self, data: bytes) -> int:
        return self._socket.send(data)

    def _number(self) -> int:
        return self._socket.fileno()

    def _shut(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
