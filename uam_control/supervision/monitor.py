"""One quantity against its limits, with hysteresis in time and value."""

from __future__ import annotations

import math
from enum import IntEnum


class Level(IntEnum):
    """How bad something is: what it calls for."""

    FINE = 0
    HOLD = 1
    LAND = 2
    FAILSAFE = 3


REACTIONS = (Level.HOLD, Level.LAND, Level.FAILSAFE)


class Monitor:
    """Rises to a level when a value went beyond that level's limit long enough ago and has not been
    clear of it since; falls back when it has been clear for long enough.

    Clear is what is within the limit by the hysteresis. `level`: now; `value`: the last one.
    """

    def __init__(self) -> None:
        self.level = Level.FINE
        self.value = -math.inf
        self._since: list[float | None] = [None] * len(REACTIONS)
        self._clear_since: float | None = None

    @property
    def quiet(self) -> bool:
        """Whether nothing is beyond a limit, or was lately."""
        return not self.level and self._since == [None] * len(REACTIONS)

    def update(
        self,
        stamp: float,
        value: float,
        limits: tuple[float, float, float],
        after: tuple[float, float, float],
        clear_after: float,
        hysteresis: float,
    ) -> Level:
        """Take a value at `stamp` [s] and return the level; larger is worse, NaN beyond all.

        limits: of REACTIONS, infinite where there is none. after, clear_after: times [s].
        hysteresis: part of the size of a limit.
        """
        self.value = value
        reached = Level.FINE
        for i, reaction in enumerate(REACTIONS):
            limit = limits[i]
            if limit == math.inf or value < limit - hysteresis * abs(limit):
                self._since[i] = None
            elif self._since[i] is None and not value < limit:
                self._since[i] = stamp
            since = self._since[i]
            if since is not None and stamp - since >= after[i]:
                reached = reaction
        if reached >= self.level:
            self.level, self._clear_since = reached, None
        elif self._since[self.level - 1] is None:
            if self._clear_since is None:
                self._clear_since = stamp
            if stamp - self._clear_since >= clear_after:
                self.level, self._clear_since = reached, None
        else:
            self._clear_since = None
        return self.level
