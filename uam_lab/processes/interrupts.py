"""Ctrl-C during a flight: noted, so that nothing breaks half-way, and acted upon in order."""

from __future__ import annotations

import signal

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupts:
    """Counts SIGINT, SIGTERM and SIGHUP while the `with` block runs, instead of what they do."""

    def __init__(self):
        self.count = 0
        self._before: dict[int, object] = {}

    @property
    def raised(self) -> bool:
        """Whether the flight is to end."""
        return self.count > 0

    @property
    def impatient(self) -> bool:
        """Whether the user asked again: end it at once."""
        return self.count > 1

    def _note(self, *_) -> None:
        self.count += 1

    def __enter__(self) -> Interrupts:
        self._before = {number: signal.signal(number, self._note) for number in SIGNALS}
        return self

    def __exit__(self, *exception) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
