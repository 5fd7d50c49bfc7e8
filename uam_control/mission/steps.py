"""Values that a scenario switches, looked up at every tick, and an operator's word on one."""

import math
from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

V = TypeVar("V")


class Steps(Generic[V]):
    """Remembers the value of the newest look-up, and between which times it holds; `until` [s]: the
    end of these."""

    def __init__(self, value: Callable[[float], V], times: Iterable[float]) -> None:
        """value: of a time [s]; times [s] at which it may change, in any order."""
        self._find, self._times = value, tuple(times)
        self._begin = self.until = math.nan  # no time is between them

    def at(self, time: float) -> V:
        """Return the value at `time` [s]."""
        if not self._begin <= time < self.until:
            self._value = self._find(time)
            self._begin = max((at for at in self._times if at <= time), default=-math.inf)
            self.until = min((at for at in self._times if at > time), default=math.inf)
        return self._value


class MagnetOverride:
    """An operator's word on the magnet, which counts until the scenario switches it next."""

    def __init__(self) -> None:
        self._given: tuple[bool, bool] | None = None  # overriding value, scenario's value then

    @property
    def given(self) -> bool:
        """Whether there is one."""
        return self._given is not None

    def give(self, on: bool, scenario: bool) -> None:
        """Override by `on`; scenario: its present value."""
        self._given = on, scenario

    def forget(self) -> None:
        """Override no more."""
        self._given = None

    def value(self, desired: bool) -> bool | None:
        """Return the overriding value, None for none; desired: the scenario's value now."""
        if self._given is None:
            return None
        on, before = self._given
        if desired != before:
            self._given = None
            return None
        return on
