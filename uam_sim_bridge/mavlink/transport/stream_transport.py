"""MAVLink over a byte stream (TCP, serial, USB): whole frames, no blocking, reopened after a loss.

A frame that does not fit into the system's buffer is dropped and counted. The rest of a partly
written frame is sent before the next frame, so the receiver never gets half a frame. After a loss
`send` and `receive` try to open the link again at growing intervals; there is no thread.
"""

import contextlib
import errno
import os
import select
import socket
import termios
import time
from collections.abc import Callable

import serial

from uam_sim_bridge.ports import PortError, serial_problem

FIRST_RETRY, LAST_RETRY = 0.1, 5.0  # s between attempts to open: first value, doubled up to last
CHUNK = 65536  # bytes
READ_LIMIT = 1 << 20  # bytes per call: bounds the time of a call
BITS_PER_BYTE = 10  # start, eight data bits, stop
CONNECT_PATIENCE = 3.0  # s, time limit of one attempt to connect
# ms without an acknowledgement after which the link is lost: setpoints must not arrive much later
SILENT_PEER = 1500


def resolve(host: str) -> str:
    """Return the IPv4 address of a host name; raises PortError in one line if there is none."""
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise PortError(f"host {host}: {reason}") from None


class StreamTransport:
    """Base class of TCP and serial links.

    A subclass implements `_open` (sets `_opened`, returns whether the link is up, raises OSError on
    failure), `_read` and `_write`.
    """

    stream = True
    bytes_per_second: float | None = None

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """clock: wall time [s], for the intervals between attempts."""
        self.connected = False
        self.dropped = self.losses = 0  # frames not sent, losses of the link
        self._clock = clock
        self._rest = b""
        self._opened: serial.Serial | socket.socket | None = None
        self._delay = FIRST_RETRY
        self._due = -float("inf")

    def send(self, data: bytes) -> bool:
        """Send one frame or drop it; return whether it is sent."""
        if self._ready() and self._flush():
            self._rest = data
            self._flush()
            if self.connected:
                return True
        self.dropped += 1
        return False

    def receive(self) -> list[bytes]:
        chunks, left = [], READ_LIMIT
        while left > 0 and self._ready() and (self._flush() or self.connected):
            try:
                data = self._read()
            except OSError:
                self._lose()
                break
            if not data:
                break
            chunks.append(data)
            left -= len(data)
        return chunks

    def fileno(self) -> int:
        """Return the descriptor for select, -1 while the link is down."""
        return self._opened.fileno() if self.connected else -1

    def close(self) -> None:
        """Close permanently."""
        self._due = float("inf")
        self._rest = b""
        self.connected = False
        self._shut()

    def _ready(self) -> bool:
        if self.connected:
            return True
        now = self._clock()
        if now < self._due:
            return False
        try:
            self.connected = self._open(now)
        except OSError:
            self._shut()
            self._due = now + self._delay
            self._delay = min(2.0 * self._delay, LAST_RETRY)
            return False
        if self.connected:
            self._delay, self._rest = FIRST_RETRY, b""
        return self.connected

    def _flush(self) -> bool:
        """Write the rest of the last frame; return whether all of it is written."""
        while self._rest and self.connected:
            try:
                written = self._write(self._rest)
            except BlockingIOError:
                return False
            except OSError:
                self._lose()
                return False
            if written == 0:
                return False
            self._rest = self._rest[written:]
        return self.connected

    def _lose(self) -> None:
        self.connected = False
        self.losses += 1
        self._rest = b""
        self._due = self._clock() + self._delay
        self._shut()

    def _open(self, now: float) -> bool:
        raise NotImplementedError

    def _read(self) -> bytes:
        """Return the available bytes, b"" if there are none; raise OSError if the link is lost."""
        raise NotImplementedError

    def _write(self, data: bytes) -> int:
        raise NotImplementedError

    def _shut(self) -> None:
        opened, self._opened = self._opened, None
        if opened is not None:
            with contextlib.suppress(OSError):  # unplugged
                opened.close()


class SerialTransport(StreamTransport):
    """A serial device, opened exclusively; opened again after it was unplugged."""

    def __init__(
        self,
        device: str,
        baud: int,
        clock: Callable[[], float] = time.monotonic,
        absent: bool = False,
    ) -> None:
        """Open `device` at `baud` [bit/s]; raises PortError in one line if that fails.

        absent: the device may be plugged in later, as after a loss.
        """
        super().__init__(clock)
        self._device, self._baud = device, baud
        self.bytes_per_second = baud / BITS_PER_BYTE
        try:
            self.connected = self._open(0.0)
        except (OSError, ValueError, OverflowError) as error:
            if absent and isinstance(error, OSError):
                self._shut()
                return
            raise PortError(
                f"serial device {device} at {baud} baud: {serial_problem(error)}"
            ) from None

    def _open(self, now: float) -> bool:
        try:
            self._opened = serial.Serial(self._device, self._baud, timeout=0, exclusive=True)
        except termios.error as error:  # unplugged during open; pyserial does not convert it
            raise OSError(*error.args) from None
        return True

    def _read(self) -> bytes:
        # An unplugged device is always readable and returns no bytes. Without select, read would
        # not distinguish it from an idle line.
        if not select.select([self._opened.fileno()], [], [], 0.0)[0]:
            return b""
        data = os.read(self._opened.fileno(), CHUNK)
        if not data:
            raise ConnectionResetError
        return data

    def _write(self, data: bytes) -> int:
        return os.write(self._opened.fileno(), data)


class TcpTransport(StreamTransport):
    """TCP client; connects later if the server is not listening yet, and again after a loss."""

    def __init__(
        self, remote: tuple[str, int], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """remote: host, port. Raises PortError for an unknown host; a closed port is no error."""
        super().__init__(clock)
        self._remote = (resolve(remote[0]), remote[1])  # at start-up: DNS may take seconds
        self._until = 0.0
        self._ready()

    def _open(self, now: float) -> bool:
        if self._opened is None:
            self._opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._opened.setblocking(False)
            self._opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, SILENT_PEER)
            self._until = now + CONNECT_PATIENCE
            code = self._opened.connect_ex(self._remote)
            if code not in (0, errno.EINPROGRESS):
                raise OSError(code, os.strerror(code))
        if not select.select([], [self._opened], [], 0.0)[1]:
            if now > self._until:
                raise TimeoutError
            return False
        code = self._opened.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise OSError(code, os.strerror(code))
        if self._opened.getsockname() == self._opened.getpeername():
            raise ConnectionRefusedError  # no server: on loopback the socket connected to itself
        return True

    def _read(self) -> bytes:
        try:
            data = self._opened.recv(CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError
        return data

    def _write(self, data: bytes) -> int:
        return self._opened.send(data)
