"""MAVLink over a serial line or USB."""

from __future__ import annotations

import errno
import os
import select
import termios
import time
from collections.abc import Callable

import serial

from uam_sim_bridge.mavlink.transport.stream_transport import CHUNK, StreamTransport
from uam_sim_bridge.ports import PortError

BITS_PER_BYTE = 10  # start, eight data bits, stop


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
        self._port: serial.Serial | None = None
        try:
            self.connected = self._open(0.0)
        except (OSError, ValueError, OverflowError) as error:
            if absent and isinstance(error, OSError):
                self._shut()
                return
            raise PortError(f"serial device {device} at {baud} baud: {_reason(error)}") from None

    def _open(self, now: float) -> bool:
        try:
            self._port = serial.Serial(self._device, self._baud, timeout=0, exclusive=True)
        except termios.error as error:  # unplugged during open; pyserial does not convert it
            raise OSError(*error.args) from None
        return True

    def _read(self) -> bytes:
        # An unplugged device is always readable and returns no bytes. Without select, read would
        # not distinguish it from an idle line.
        if not select.select([self._port.fileno()], [], [], 0.0)[0]:
            return b""
        data = os.read(self._port.fileno(), CHUNK)
        if not data:
            raise ConnectionResetError
        return data

    def _write(self, data: bytes) -> int:
        return os.write(self._port.fileno(), data)

    def _number(self) -> int:
        return self._port.fileno()

    def _shut(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            try:
                port.close()
            except OSError:  # unplugged
                pass


def _reason(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.EWOULDBLOCK:
        return "in use by another program"
    if number:
        return os.strerror(number)
    return " ".join(str(error).split())
