"""Sample and hold: when a command that is computed at every tick is sent anew."""

import numpy as np

from uam_control.maths.compiled import borrowing, prepared
from uam_control.maths.memory import Number, record


class SampleHold:
    """Divides time into periods of 1 / rate; a command is new at the first tick of each."""

    rate = Number()

    def __init__(self, rate: float) -> None:
        """rate [Hz]: of new commands; 0: at every tick."""
        self.memory = record("last", "rate")  # last: number of the period of the last new command
        self.memory[0] = -1, rate
        self._is_new = prepared(is_new, self.memory, 0.0)

    def due(self, time: float) -> bool:
        """See `is_new`."""
        return self._is_new(self.memory, time)


@borrowing
def is_new(hold: np.ndarray, time: float) -> bool:
    """Whether a command is new at the tick of `time` [s]; call it once per tick.

    hold (1,): memory of a `SampleHold`.
    """
    m = hold[0]
    if m.rate <= 0.0:
        return True
    number = int(time * m.rate + 1e-6)  # a tick at the beginning of a period is in it
    if number == m.last:
        return False
    m.last = number
    return True
