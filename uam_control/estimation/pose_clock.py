"""Detection of a clock of the poses that has jumped back: their stamps then say too great an age.

A late pose has a right stamp, and stamps never go back. Poses whose clock is behind would be
compared with an estimate of too early a time: the estimate leads, and the position loop swings up.
"""

from __future__ import annotations

import math

from uam_control.ages import AHEAD, usable


class PoseClock:
    """Decides for each pose, in order of arrival, whether its stamp counts."""

    def __init__(self) -> None:
        self._newest = -math.inf  # [s] stamp of the newest pose that counted
        self._age = math.inf  # [s] of that pose at its arrival
        self._behind = False

    def __call__(self, stamp: float, now: float, oldest: float) -> bool:
        """Return whether a pose of `stamp` [s] counts at `now` [s].

        It is `usable` up to an age of `oldest` [s]. After stamps that went back no pose counts
        until one is about as young as the last that did.
        """
        age = now - stamp
        if not usable(age, oldest):
            return False
        self._behind = self._behind or stamp < self._newest - AHEAD
        if self._behind and age > self._age + AHEAD:
            return False
        self._newest, self._age, self._behind = stamp, age, False
        return True
