"""A serial device without hardware: a pseudo-terminal, and the thread that serves it."""

from __future__ import annotations

import contextlib
import os
import pty
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

CHUNK = 4096  # bytes per read
PAUSE = 0.001  # [s] between two looks whether a change is over


class PseudoTerminal:
    """A device like /dev/ttyUSB0 whose other end this program holds.

    `device`: its path; `path`: the one for others, a link that may be given.
    """

    def __init__(self, link: Path | None = None) -> None:
        """link: path to create, which stays the same for the next device in its place."""
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self._slave)
        self._link, self.path = link, str(link or self.device)
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
        """Begin to serve."""
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
