"""Counts frames by their numbers: received, lost, repeated, late."""

from __future__ import annotations

RESTART = 240  # frames back, two seconds at 120 Hz: the server counts anew


class FrameCount:
    """`received`: in order; `lost`: numbers that never came; `repeated` and `late`: discarded."""

    def __init__(self) -> None:
        self.received = self.lost = self.repeated = self.late = 0
        self._last: int | None = None
        self._missing: set[int] = set()  # among the last RESTART numbers

    def restart(self) -> None:
        """Begin a session: the next number is the first."""
        self._last = None
        self._missing.clear()

    def take(self, number: int) -> bool:
        """Take the number of a frame; False: the frame is repeated or late and must not be used."""
        last = self._last
        if last is not None and last - RESTART < number <= last:
            if number in self._missing:  # overtaken by a later frame: not lost after all
                self._missing.discard(number)
                self.lost -= 1
                self.late += 1
            else:
                self.repeated += 1
            return False
        if last is not None and number > last:
            gap = number - last - 1
            self.lost += gap
            first = max(last + 1, number - RESTART)
            self._missing = {n for n in self._missing if n > number - RESTART}
            self._missing.update(range(first, number))
        else:
            self._missing.clear()
        self._last = number
        self.received += 1
        return True
