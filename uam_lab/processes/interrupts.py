"""Requests to end a flight early: by a program, or by Ctrl-C, which is only counted."""

from __future__ import annotations

import queue
import signal
from typing import Any

INTERRUPTED = 128 + signal.SIGINT  # exit status
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopRequest:
    """Request to end a flight in order, or at once if it is repeated; and faults to inject now.

    injected: queue of faults, each a `TimedFault` whose begin does not count.
    """

    def __init__(self) -> None:
        self.count = 0
        self.injected: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def repeat(self, *_) -> None:
        """Count one more request."""
        self.count += 1

    @property
    def raised(self) -> bool:
        """Whether the flight has to end."""
        return self.count > 0

    @property
    def impatient(self) -> bool:
        """Whether the flight has to end at once."""
        return self.count > 1


class Interrupts(StopRequest):
    """Context manager that counts SIGINT, SIGTERM and SIGHUP instead of their normal effect."""

    def __init__(self) -> None:
        super().__init__()
        self._before: dict[int, object] = {}

    def __enter__(self) -> Interrupts:
        self._before = {number: signal.signal(number, self.repeat) for number in SIGNALS}
        return self

    def __exit__(self, *exception) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
