"""MAVLink over a byte stream (TCP, serial): whole frames, no blocking, reopened after a loss.

A frame that does not fit into the system's buffer is dropped and counted. The rest of a partly
written frame is sent before the next frame, so the receiver never gets half a frame. After a loss
`send` and `receive` try to open the link again at growing intervals; there is no thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable

FIRST_RETRY, LAST_RETRY = 0.1, 5.0  # s between attempts to open: first value, doubled up to last
CHUNK = 65536  # bytes
READ_LIMIT = 1 << 20  # bytes per call: bounds the time of a call


class StreamTransport:
    """Base class of TCP and serial links.

    `connected`: link is open; `dropped`: frames not sent; `losses`: number of link losses. A
    subclass implements `_open` (returns whether the link is up, raises OSError on failure),
    `_read`, `_write`, `_number` and `_shut`.
    """

    stream = True
    bytes_per_second: float | None = None

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """clock: wall time [s], for the intervals between attempts."""
        self.connected = False
        self.dropped = self.losses = 0
        self._clock = clock
        self._rest = b""
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
        """Return the chunks that have arrived."""
        chunks, left = [], READ_LIMIT
        while left > 0 and self._ready() and self._flush_some():
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
        return self._number() if self.connected else -1

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

    def _flush_some(self) -> bool:
        self._flush()
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

    def _number(self) -> int:
        raise NotImplementedError

    def _shut(self) -> None:
        raise NotImplementedError
