"""Ctrl-C during a flight: only counted, so that the flight can end in order."""

from __future__ import annotations

import signal

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupts:
    """Context manager that counts SIGINT, SIGTERM and SIGHUP instead of their normal effect."""

    def __init__(self):
        self.count = 0
        self._before: dict[int, object] = {}

    @property
    def raised(self) -> bool:
        """Whether a signal was received: the flight has to end."""
        return self.count > 0

    @property
    def impatient(self) -> bool:
        """Whether a second signal was received: the flight has to end at once."""
        return self.count > 1

    def _note(self, *_) -> None:
        self.count += 1

    def __enter__(self) -> Interrupts:
        self._before = {number: signal.signal(number, self._note) for number in SIGNALS}
        return self

    def __exit__(self, *exception) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
