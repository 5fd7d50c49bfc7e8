"""Sample and hold: when a command that is computed at every tick is sent anew."""

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import record


def new_hold(rate: float) -> np.ndarray:
    """Return the memory (1,) of `is_new`; rate [Hz]: of new commands, 0: at every tick."""
    hold = record("last", "rate")  # last: number of the period of the last new command
    hold[0] = -1, rate
    return hold


@borrowing
def is_new(hold: np.ndarray, time: float) -> bool:
    """Whether a command is new at the tick of `time` [s]; call it once per tick.

    hold (1,): see `new_hold`. Time is divided into periods of 1 / rate; a command is new at the
    first tick of each.
    """
    m = hold[0]
    if m.rate <= 0.0:
        return True
    number = int(time * m.rate + 1e-6)  # a tick at the beginning of a period is in it
    if number == m.last:
        return False
    m.last = number
    return True
