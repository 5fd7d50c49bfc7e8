"""A value that changes at certain times only, looked up at every tick."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

V = TypeVar("V")


class Steps(Generic[V]):
    """Remembers the value of the newest look-up, and between which times it holds."""

    def __init__(self, value: Callable[[float], V], times: Iterable[float]) -> None:
        """value: of a time [s]; times [s] at which it may change, in any order."""
        self._find, self._times = value, tuple(times)
        self._begin = self._end = math.nan  # no time is between them

    @property
    def until(self) -> float:
        """The time [s] until which the value of the newest look-up holds."""
        return self._end

    def at(self, time: float) -> V:
        """Return the value at `time` [s]."""
        if not self._begin <= time < self._end:
            self._value = self._find(time)
            self._begin = max((at for at in self._times if at <= time), default=-math.inf)
            self._end = min((at for at in self._times if at > time), default=math.inf)
        return self._value
