"""Requests to end a flight early: by a program, or by Ctrl-C, which is only counted."""

import os
import queue
import signal
from typing import Any, Self

INTERRUPTED = 128 + signal.SIGINT  # exit status
OUTPUTS = (1, 2)  # file descriptors of standard output and error
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopRequest:
    """Request to end a flight in order, or at once if it is repeated; and faults to inject now."""

    def __init__(self) -> None:
        self.count = 0
        # each fault is a `TimedFault` whose begin does not count
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
    """Context manager that counts SIGINT, SIGTERM and SIGHUP instead of their normal effect.

    A SIGHUP that is ignored stays ignored: `nohup` starts a program so. A closed terminal ends the
    flight in order; what would be written to it is lost.
    """

    def __init__(self) -> None:
        super().__init__()
        self._before: dict[int, object] = {}
        self._terminals: list[int] = []  # file descriptors

    def __enter__(self) -> Self:
        self._terminals = [output for output in OUTPUTS if os.isatty(output)]
        handlers = dict.fromkeys(SIGNALS, self.repeat) | {signal.SIGHUP: self._hung_up}
        if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
            del handlers[signal.SIGHUP]
        self._before = {number: signal.signal(number, to) for number, to in handlers.items()}
        return self

    def _hung_up(self, *_) -> None:
        """Count the request; writing to a closed terminal would raise."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for output in self._terminals:
            os.dup2(nowhere, output)
        os.close(nowhere)
        self.repeat()

    def __exit__(self, *exception) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
