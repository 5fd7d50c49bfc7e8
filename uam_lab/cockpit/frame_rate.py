"""Frame rate of the page: fast on an idle machine, slow when watching would cost the flight."""

from __future__ import annotations

import time
from collections.abc import Callable

import psutil

INTERVAL = 1.0  # [s] of one measurement
SHARE = 0.08  # [cores] for this process while the machine is short; the limit is a tenth
BUSY = 0.85  # of all processor time: from here on the machine is short
REST = 10  # measurements without shortage before the page shows everything again
STEP = 2.0  # largest change of the period per measurement


class FrameRate:
    """Period between two frames, from the processor time of this process and of the machine."""

    def __init__(
        self,
        fastest: float,
        slowest: float,
        clock: Callable[[], float] = time.monotonic,
        own: Callable[[], float] | None = None,
        machine: Callable[[], float] | None = None,
    ) -> None:
        """fastest, slowest: periods [s]; own: processor time of this process so far [s]; machine:
        used share of all processor time since the last call, 0..1.
        """
        self._fastest, self._slowest, self._clock = fastest, slowest, clock
        self._own, self._machine = own or _process_time, machine or _machine_load
        self._machine()
        self._last = clock(), self._own()
        self.period = fastest  # [s]
        self.short = False  # whether the machine is short
        self.cores = 0.0  # used by this process
        self.sparing = False  # whether the slowest frame rate still costs too much
        self._rested = 0  # measurements since the machine was last short

    def measure(self) -> None:
        """Adapt the period to the last INTERVAL; call it with each frame."""
        now, used = self._clock(), self._own()
        spent = now - self._last[0]
        if spent < INTERVAL:
            return
        self.cores, self._last = (used - self._last[1]) / spent, (now, used)
        self.short = self._machine() >= BUSY
        factor = self.cores / SHARE if self.short else 1.0 / STEP
        factor = min(STEP, max(1.0 / STEP, factor))
        before, self.period = (
            self.period,
            min(self._slowest, max(self._fastest, self.period * factor)),
        )
        self._rested = 0 if self.short else self._rested + 1
        if self.short and before >= self._slowest and self.cores > SHARE:
            self.sparing = True
        elif self._rested >= REST:
            self.sparing = False


def _process_time() -> float:
    times = psutil.Process().cpu_times()
    return times.user + times.system


def _machine_load() -> float:
    return psutil.cpu_percent() / 100.0
