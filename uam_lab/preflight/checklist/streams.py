"""Rate, gaps and losses of a stream of samples, from their stamps."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

SPAN = 2.0  # [s] of stamps that are kept
FEWEST = 5  # stamps
# of a period: a step that is longer by this much has a sample missing. Less than one, for stamps
# jitter; more than a half: frames on a simulation's ticks of 4 ms come 8 or 12 ms after each other
LATE = 0.75


@dataclass(frozen=True)
class StreamReport:
    """rate [Hz]; gap [s]: longest time without a sample; loss: share of missing samples, 0..1."""

    rate: float
    gap: float
    loss: float


class Stream:
    """Stamps of the last SPAN."""

    def __init__(self) -> None:
        self._stamps: deque[float] = deque()

    def add(self, stamp: float) -> None:
        """Take the stamp [s] of a sample; after a stamp that goes back the stream begins anew."""
        if self._stamps and stamp < self._stamps[-1]:
            self._stamps.clear()
        self._stamps.append(stamp)
        while stamp - self._stamps[0] > SPAN:
            self._stamps.popleft()

    def report(self, now: float) -> StreamReport | None:
        """Return the report at `now` [s]; None without samples in the last SPAN.

        The share of missing samples counts from the median distance of two stamps.
        """
        recent = [one for one in self._stamps if now - one <= SPAN]
        if len(recent) < FEWEST:
            return None
        steps = np.diff(recent)
        period = float(np.median(steps))
        if period <= 0.0:
            return None
        missing = float(np.sum(np.maximum(np.floor(steps / period - LATE), 0.0)))
        silence = max(0.0, now - recent[-1])
        # a stream that has stopped loses its rate
        rate = (len(recent) - 1) / (recent[-1] - recent[0] + max(0.0, silence - 10.0 * period))
        return StreamReport(
            rate, max(float(steps.max()), silence), missing / (missing + len(recent))
        )
