"""Sample and hold: when a command that is computed at every tick is sent anew."""

from __future__ import annotations


class SampleHold:
    """Divides time into periods of 1 / rate; a command is new at the first tick of each."""

    def __init__(self, rate: float) -> None:
        """rate [Hz]: of new commands; 0: at every tick."""
        self.rate = rate
        self._last: int | None = None  # number of the period of the last new command

    def due(self, time: float) -> bool:
        """Whether a command is new at the tick of `time` [s]; call it once per tick."""
        if self.rate <= 0.0:
            return True
        number = int(time * self.rate + 1e-6)  # a tick at the beginning of a period is in it
        if number == self._last:
            return False
        self._last = number
        return True
