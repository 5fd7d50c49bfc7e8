"""Offset and drift between the server's clock and the host's, from one-way messages.

arrival − sent = offset + delay of the network, and the delay is never below its least value. The
lowest points of arrival − sent over a window therefore lie on a line: its slope is the drift of the
clocks. The offset is late by the least delay of the network, some 0.1 ms on a cable, and by nothing
else: the time between exposure and transmission is known from the server's stamps.
"""

from __future__ import annotations

from collections import deque

import numpy as np

BLOCK = 1.0  # [s] each block of this length contributes its lowest point
BLOCKS = 20  # window of the line
FEWEST = 5  # blocks for a drift
DRIFT_MAX = 5e-4  # crystals differ by 1e-4, NTP steers by 5e-4 at most
JUMP = 0.1  # [s] a clock that was set, or a server that was restarted


class ClockOffset:
    """Follows the offset, host − server; `value` [s] at the newest message, None before the first.

    `drift`: of the offset [s/s]; `jumps`: how often a clock was set.
    """

    def __init__(self) -> None:
        self.jumps = 0
        self.restart()

    def restart(self) -> None:
        """Forget everything: another server, or another session of it."""
        self._blocks: deque[tuple[float, float]] = deque(maxlen=BLOCKS)  # time, lowest offset
        self._lowest: tuple[float, float] | None = None  # of the present block
        self._begun = 0.0  # server's time [s] at which the present block began
        self._level = self.drift = 0.0  # line through (_at, _level)
        self._at = 0.0
        self.value: float | None = None

    def add(self, sent: float, arrival: float) -> None:
        """Take a message: sent [s] by the server's clock, arrival [s] by the host's."""
        offset = arrival - sent
        if self._lowest is None:
            self._begin(sent, offset)
        elif self._jumped(sent, offset):
            self.jumps += 1
            self.restart()
            self._begin(sent, offset)
        if sent - self._begun >= BLOCK:
            self._blocks.append(self._lowest)
            self._begun, self._lowest = sent, (sent, offset)
            self._fit()
        elif offset < self._lowest[1]:
            self._lowest = sent, offset
        self._level = min(self._level, offset - self.drift * (sent - self._at))
        self.value = self._line(sent)

    def host(self, time: float) -> float:
        """Return a server's time [s] in the host's clock [s]; after the first message."""
        return time + self._line(time)

    def _begin(self, sent: float, offset: float) -> None:
        self._begun, self._lowest = sent, (sent, offset)
        self._at, self._level = sent, offset

    def _line(self, time: float) -> float:
        return self._level + self.drift * (time - self._at)

    def _jumped(self, sent: float, offset: float) -> bool:
        """Whether a clock was set: one message far too early, or a whole block far too late."""
        if sent < self._begun - JUMP or self._blocks and offset < self._line(sent) - JUMP:
            return True
        late = self._lowest[1] - self._line(self._lowest[0])
        return sent - self._begun >= BLOCK and late > JUMP

    def _fit(self) -> None:
        """Put the line below all blocks; with fewer than FEWEST of them it is level."""
        times, lowest = np.array(self._blocks).T
        self._at = times[-1]
        if len(times) >= FEWEST:
            slope = np.polyfit(times - self._at, lowest - lowest[-1], 1)[0]
            self.drift = float(np.clip(slope, -DRIFT_MAX, DRIFT_MAX))
        self._level = float(np.min(lowest - self.drift * (times - self._at)))
