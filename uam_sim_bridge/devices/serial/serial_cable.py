"""Serial devices without hardware: a pseudo-terminal, and a cable of two with their timing.

The programs open `near` and `far`, devices like /dev/ttyUSB0. One thread carries the bytes. The
near end is a USB adapter: unplugged, its device is gone. A cut cable is silent, both devices stay.
"""

from __future__ import annotations

import contextlib
import os
import pty
import select
import termios
import threading
import time
import tty
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from uam_sim_bridge.devices.serial.serial_port import BITS_PER_BYTE

IDLE = 0.02  # [s] longest wait
HELD = 65536  # bytes under way in one direction; a UART's sender would wait
CHUNK = 4096  # bytes per read
PAUSE = 0.001  # [s] between two looks whether a change is over


class PseudoTerminal:
    """A device like /dev/ttyUSB0 whose other end this program holds."""

    def __init__(self, link: Path | None = None) -> None:
        """link: path to create, which stays the same for the next device in its place."""
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self._slave)  # its path
        self._link, self.path = link, str(link or self.device)  # path for others
        if link is not None:
            link.unlink(missing_ok=True)
            link.symlink_to(self.device)

    def fileno(self) -> int:
        """Return the own end, for `select`."""
        return self._master

    @property
    def speed(self) -> int:
        """Return the speed that the other program has set, as a constant of `termios`."""
        return termios.tcgetattr(self._slave)[5]

    def read(self) -> bytes:
        """Return the bytes that have come, b"" for none."""
        try:
            return os.read(self._master, CHUNK)
        except OSError:  # none, or the other program has closed its end
            return b""

    def write(self, data: bytes) -> None:
        """Send bytes; those that nobody reads are lost, as in a full UART."""
        try:
            os.write(self._master, data)
        except BlockingIOError:
            with contextlib.suppress(termios.error):
                termios.tcflush(self._slave, termios.TCIFLUSH)
        except OSError:
            pass

    def close(self) -> None:
        """Remove the device, as a pulled USB adapter."""
        if self._link is not None:
            self._link.unlink(missing_ok=True)
        for end in (self._master, self._slave):
            os.close(end)


class DeviceThread:
    """Calls `serve` again and again until `end`; devices are exchanged inside `changed`."""

    def __init__(self, name: str, serve: Callable[[], None]) -> None:
        """serve: one turn; it waits for bytes, at most some hundredths of a second."""
        self._serve = serve
        self._lock = threading.Lock()
        self._stop, self._pause = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def end(self) -> None:
        """Stop serving, after the turn."""
        self._stop.set()
        self._thread.join()

    @contextlib.contextmanager
    def changed(self) -> Iterator[None]:
        """Keep the thread away from the devices while they are created or removed."""
        self._pause.set()
        with self._lock:
            yield
        self._pause.clear()

    def _run(self) -> None:
        while not self._stop.is_set():
            if self._pause.is_set():
                time.sleep(PAUSE)
                continue
            with self._lock:
                self._serve()


def disturbed(data: bytes, rate: float, noise: np.random.Generator) -> bytes:
    """Return `data` with each bit inverted with probability `rate`."""
    if not rate or not data:
        return data
    flips = noise.random(8 * len(data)) < rate
    return (np.frombuffer(data, np.uint8) ^ np.packbits(flips)).tobytes()


class Wire:
    """One direction: when each chunk has arrived at the other end.

    A chunk occupies the wire for its length at the baud rate, after those before it.
    """

    def __init__(self, baud: int) -> None:
        """baud [bit/s]."""
        self._second = BITS_PER_BYTE / baud  # per byte
        self._free = 0.0  # [s] when the last byte has left
        self._under_way: deque[tuple[float, bytes]] = deque()
        self.held = 0  # bytes under way

    def put(self, data: bytes, now: float) -> None:
        """Take a chunk at `now` [s]."""
        self._free = max(self._free, now) + len(data) * self._second
        self._under_way.append((self._free, data))
        self.held += len(data)

    def take(self, now: float) -> bytes:
        """Return the bytes that have arrived by `now` [s]."""
        found = b""
        while self._under_way and self._under_way[0][0] <= now:
            found += self._under_way.popleft()[1]
        self.held -= len(found)
        return found

    @property
    def due(self) -> float | None:
        """Return when the next bytes arrive [s], None without any."""
        return self._under_way[0][0] if self._under_way else None

    def clear(self) -> None:
        self._under_way.clear()
        self.held = 0


class SerialCable:
    """`near`, `far`: paths of the devices; `bit_error_rate`: of every bit, in both directions."""

    def __init__(self, near: Path, far: Path, baud: int, seed: int = 1) -> None:
        """near, far: paths to create, which stay the same when the cable is plugged in again."""
        self.near, self.far = near, far
        self.bit_error_rate = 0.0
        self.cut = False
        self.carried = [0, 0]  # bytes from the near and from the far end
        self._noise = np.random.default_rng(seed)
        self._wires = Wire(baud), Wire(baud)  # from the near end, from the far end
        self._thread = DeviceThread("serial cable", self._carry)
        self._ends: list[PseudoTerminal | None] = [PseudoTerminal(near), PseudoTerminal(far)]
        self._thread.start()

    def unplug(self) -> None:
        """Remove the near device, as a pulled USB adapter."""
        with self._thread.changed():
            self._remove(0)

    def plug_in(self) -> None:
        """Create the near device again, under the same path."""
        with self._thread.changed():
            if self._ends[0] is None:
                self._ends[0] = PseudoTerminal(self.near)

    def close(self) -> None:
        self._thread.end()
        for end in (0, 1):
            self._remove(end)

    def _remove(self, end: int) -> None:
        terminal = self._ends[end]
        if terminal is not None:
            terminal.close()
        self._ends[end] = None
        for wire in self._wires:
            wire.clear()

    def _carry(self) -> None:
        """Wait for bytes, and carry those that are due."""
        open_ends = [
            terminal
            for terminal, wire in zip(self._ends, self._wires, strict=True)
            if terminal is not None and wire.held < HELD
        ]
        due = [wire.due for wire in self._wires if wire.due is not None]
        wait = min([IDLE, *(max(0.0, one - time.monotonic()) for one in due)])
        readable = select.select(open_ends, [], [], wait)[0] if open_ends else []
        if not open_ends:
            time.sleep(wait)
        for end, wire in enumerate(self._wires):
            terminal, other = self._ends[end], self._ends[1 - end]
            if terminal in readable:
                data = terminal.read()
                self.carried[end] += len(data)
                if not self.cut and other is not None:
                    wire.put(disturbed(data, self.bit_error_rate, self._noise), time.monotonic())
            arrived = wire.take(time.monotonic())
            if arrived and other is not None:
                other.write(arrived)
