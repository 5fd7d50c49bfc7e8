"""How far the autopilot's clock is from ours, and how long a question takes: TIMESYNC, our side.

A request carries our time, the answer repeats it and adds the autopilot's. Half-way between the two
is when the autopilot read its clock, give or take half the round trip: quick answers count more.
Times are those of the control ticks, so a round trip is seen in steps of a tick.
"""

from __future__ import annotations

import math
from collections import deque

PERIOD = 0.2  # s between two requests
JUMP = 0.1  # s beyond what the round trip explains: another clock, not another delay
JUMPS_TO_RESET = 2  # in a row: one may be a damaged answer
_OUTSTANDING = 16  # requests whose answers are still accepted
_RECENT = 25  # answers over which the quickest is looked for
_SLOWEST_GAIN = 0.05
_SHORTEST = 1e-3  # s: what counts as no round trip at all
_NEWEST = 5  # answers, those of a second


class TimeSync:
    """Requests to send and the estimate from their answers.

    `offset` [s] or None: autopilot's clock − ours; `round_trip` [s] or None: smoothed; `resets`:
    how often the autopilot's clock jumped.
    """

    def __init__(self) -> None:
        self.resets = 0
        self._asked: deque[int] = deque(maxlen=_OUTSTANDING)
        self._last = -math.inf
        self.restart()

    def restart(self) -> None:
        """Forget the estimate, for a new autopilot or one that has rebooted."""
        self.offset: float | None = None
        self.round_trip: float | None = None
        self._count = self._jumps = 0
        self._recent: deque[float] = deque(maxlen=_RECENT)

    @property
    def quickest(self) -> float | None:
        """Round trip [s] of the quickest answer of the last second; None before there are enough.

        A single late answer does not count, a slow link does at once.
        """
        newest = list(self._recent)[-_NEWEST:]
        return min(newest) if len(newest) == _NEWEST else None

    def request(self, time: float) -> int | None:
        """Return the ts1 [ns] of the request due at `time` [s], None where none is due."""
        if time - self._last < PERIOD - 1e-9:
            return None
        self._last = time
        ts1 = nanoseconds(time)
        self._asked.append(ts1)
        return ts1

    def answer(self, time: float, tc1: int, ts1: int) -> bool:
        """Take an answer arriving at `time` [s]; True where the autopilot's clock has jumped.

        tc1: the autopilot's time [ns]; ts1: that of our request, others are ignored.
        """
        if ts1 not in self._asked:
            return False
        self._asked.remove(ts1)
        round_trip = time - ts1 * 1e-9
        if round_trip < 0.0:  # our own clock went back: a new flight of the simulator
            self.restart()
            return False
        offset = tc1 * 1e-9 - (ts1 * 1e-9 + time) / 2.0
        if self.offset is not None and abs(offset - self.offset) > JUMP + round_trip / 2.0:
            self._jumps += 1
            if self._jumps < JUMPS_TO_RESET:
                return False
            self.restart()
            self.resets += 1
            self._take(offset, round_trip)
            return True
        self._jumps = 0
        self._take(offset, round_trip)
        return False

    def _take(self, offset: float, round_trip: float) -> None:
        self._count += 1
        self._recent.append(max(round_trip, _SHORTEST))
        gain = max(1.0 / self._count, _SLOWEST_GAIN)
        if self.offset is None or self.round_trip is None:
            self.offset, self.round_trip = offset, round_trip
            return
        self.round_trip += gain * (round_trip - self.round_trip)
        # the error of an offset is up to half its round trip: weigh by the square of its quickness
        quickness = min(self._recent) / self._recent[-1]
        self.offset += gain * quickness**2 * (offset - self.offset)


def nanoseconds(time: float) -> int:
    """Return `time` [s] as TIMESYNC carries it; 0 would say "a request", hence at least 1."""
    return max(1, round(time * 1e9))
