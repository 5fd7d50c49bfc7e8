"""Detection of a clock of the poses that has jumped: their stamps then say a wrong age.

A late pose has a right stamp, and stamps never go back. Poses whose clock is behind would be
compared with an estimate of too early a time: the estimate leads, and the position loop swings up.
Poses that are ahead while samples keep coming would count late.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.ages import AHEAD, AHEAD_FOR, usable
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import record

# newest [s]: stamp of the newest pose that counted, age [s]: of that at its arrival; ahead_since
# [s]: stamp of the IMU since which every pose is far ahead, inf: the last one was not
WHOLE, REAL = "behind", "newest age ahead_since"


class PoseClock:
    """Decides for each pose, in order of arrival, whether its stamp counts."""

    def __init__(self) -> None:
        self.memory = record(WHOLE, REAL)
        forget_clock(self.memory)

    def __call__(self, stamp: float, now: float, oldest: float) -> bool:
        """See `counts`."""
        return counts(self.memory, stamp, now, oldest)


@borrowing
def forget_clock(clock: np.ndarray) -> None:
    """Know no pose; clock (1,): memory of a `PoseClock`."""
    m = clock[0]
    m.behind = False
    m.newest = -math.inf
    m.age = m.ahead_since = math.inf


@borrowing
def counts(clock: np.ndarray, stamp: float, now: float, oldest: float) -> bool:
    """Return whether a pose of `stamp` [s] counts at `now` [s]; clock: see `forget_clock`.

    It is `usable` up to an age of `oldest` [s]. After stamps that went back no pose counts
    until one is about as young as the last that did.
    """
    m, age = clock[0], now - stamp
    if not usable(age, oldest):
        return False
    if stamp < m.newest - AHEAD:
        m.behind = True
    if m.behind and age > m.age + AHEAD:
        return False
    m.newest, m.age, m.behind = stamp, age, False
    return True


@borrowing
def waits(clock: np.ndarray, stamp: float, newest: float) -> bool:
    """Return whether a pose of `stamp` [s] may wait for its IMU sample; newest [s]: of the IMU.

    An IMU that pauses leaves poses far ahead. They are an error of the clock if samples come in
    between: before one of them would be used, at an age that it does not have.
    """
    m = clock[0]
    m.ahead_since = min(m.ahead_since, newest) if stamp - newest > AHEAD else math.inf
    return newest - m.ahead_since <= AHEAD_FOR
