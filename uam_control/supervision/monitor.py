"""Monitor of one quantity against its limits, with hysteresis in time and value."""

import math
from enum import IntEnum

from uam_control.settings.plain_members import plain_members


@plain_members
class Level(IntEnum):
    """Required reaction, in order of severity."""

    FINE = 0
    HOLD = 1
    LAND = 2
    FAILSAFE = 3


REACTIONS = (Level.HOLD, Level.LAND, Level.FAILSAFE)


class Monitor:
    """Level of one quantity.

    The level rises when the value has exceeded the limit of a higher level for the time `after`,
    without being clear in between. It falls when the value has been clear for `clear_after`. Clear
    means: within the limit by at least the hysteresis.
    """

    def __init__(self) -> None:
        self.level = Level.FINE  # current one
        self.value = -math.inf  # last one
        self._largest = [-math.inf] * len(REACTIONS)
        self._since: list[float | None] = [None] * len(REACTIONS)
        self._clear_since: float | None = None

    @property
    def largest(self) -> float:
        """See the class; the value itself may be below the limit, but not below the hysteresis."""
        return self._largest[self.level - 1] if self.level else self.value

    @property
    def quiet(self) -> bool:
        """Return whether no limit is exceeded or waits to become clear."""
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
        """Update with a value at `stamp` [s] and return the level; NaN exceeds all limits.

        limits, after: of each of REACTIONS, the limit (inf: none) and the time beyond it [s].
        clear_after [s]; hysteresis: fraction of a limit's size.
        """
        self.value = value
        reached = Level.FINE
        for i, reaction in enumerate(REACTIONS):
            limit = limits[i]
            if limit == math.inf or value < limit - hysteresis * abs(limit):
                self._since[i] = None
            elif self._since[i] is None and not value < limit:
                self._since[i], self._largest[i] = stamp, value
            since = self._since[i]
            if since is not None and not value <= self._largest[i]:
                self._largest[i] = value
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
