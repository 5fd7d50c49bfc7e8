"""A serial line on which this computer asks and others answer, with the waits for the answers."""

import contextlib
import select
import termios
import time
from pathlib import Path

import serial

BITS_PER_BYTE = 10  # start, eight data bits, stop
CHUNK = 4096  # bytes per read
SYSFS = Path("/sys/bus/usb-serial/devices")


class SerialPort:
    """An answer has the time of its bytes plus `allowance` [s]; a read sleeps meanwhile.

    Every method but `close` raises OSError, termios.error or TypeError if the device is lost.
    """

    def __init__(self, device: str, allowance: float) -> None:
        """device: its path."""
        self.device, self.allowance = device, allowance
        self.byte_time = 0.0  # [s]
        self._serial: serial.Serial | None = None
        self._sent = 0  # bytes since the last answer, which may still be on their way out
        self._late = 0.0  # [s] end of the wait

    def open(self, baud_rate: int) -> None:
        """Open the device, again if it is open. Raises ValueError for an impossible baud rate."""
        self.close()
        self._serial = serial.Serial(self.device, baud_rate, timeout=0)
        self._serial.reset_input_buffer()
        self.byte_time = BITS_PER_BYTE / baud_rate

    def close(self) -> None:
        if self._serial is not None:
            with contextlib.suppress(OSError, termios.error):
                self._serial.close()

    def send(self, data: bytes) -> None:
        """Forget what has come and was not read; send bytes."""
        self._serial.reset_input_buffer()
        self._sent += len(data)
        self._serial.write(data)

    def expect(self, size: int) -> float:
        """Begin to wait for an answer of `size` bytes; return the longest wait [s]."""
        wait = self.byte_time * (size + self._sent) + self.allowance
        self._sent, self._late = 0, time.monotonic() + wait
        return wait

    def look(self) -> None:
        """From now on read only what has come already."""
        self._late = 0.0

    def read(self) -> bytes:
        """Return the bytes that have come; wait for the first one, b"" if it is late."""
        while True:
            data = self._serial.read(CHUNK)
            left = self._late - time.monotonic()
            if data or left <= 0.0:
                return data
            select.select([self._serial], [], [], left)


def latency_timer(device: str, sysfs: Path = SYSFS) -> float | None:
    """Return the latency timer [s] of a serial device; None for an adapter without one."""
    file = sysfs / Path(device).resolve().name / "latency_timer"
    try:
        return 1e-3 * int(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def advice(device: str) -> str:
    """Return the command that sets the timer to 1 ms."""
    name = Path(device).resolve().name
    return f"echo 1 | sudo tee {SYSFS}/{name}/latency_timer"
