"""Joins the messages of several topics by their stamps.

The order of arrival is not used: it is random between processes, and a lockstep flight must be
reproducible bit for bit.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from uam_control.stamps import NEW_TIME

BACKLOG = 3  # ticks; equals the allowed delay of a setpoint in mujoco_sim


class Backlog:
    """Queue of complete ticks.

    Up to BACKLOG ticks are all processed, in order. Of a longer queue only the newest tick is
    processed: otherwise the delay would remain.
    """

    def __init__(self):
        self._items: list[Any] = []
        self.dropped = 0

    def put(self, item: Any) -> None:
        """Add the newest tick."""
        self._items.append(item)

    def take(self) -> list[Any]:
        """Remove and return the ticks to process now, in order."""
        items = self._items
        if not items:
            return items
        self._items = []
        if len(items) <= BACKLOG:
            return items
        self.dropped += len(items) - 1
        return items[-1:]


class Ahead(NamedTuple):
    """An input that is sent one tick ahead, for a stamp that the next tick may not have.

    serves(stamp, before, tick): whether its value of a stamp serves another tick, given the tick
    before [ns]; later(value, step): the value `step` [ns] later.
    """

    name: str
    serves: Callable[[int, int, int], bool] = lambda stamp, before, tick: False
    later: Callable[[Any, int], Any] = lambda value, step: value


class _Tick:
    """The values of one stamp; missing: how many have not arrived."""

    __slots__ = ("missing", "values")

    def __init__(self, inputs: int):
        self.values: list[Any] = [None] * inputs
        self.missing = inputs


class StampJoin:
    """Collects ticks, for each of which all inputs have delivered their values for a stamp.

    `settle` calls `fire(stamp, *values)` for them, see `Backlog`.

    Ticks fire in the order of their stamps. A firing tick drops older incomplete ticks; these, and
    later messages for them, are counted in `dropped`. Stamps that go back by more than NEW_TIME
    belong to a new simulation: the join begins anew. An input that is sent one tick `ahead` makes
    no tick alone: there is none if the sample that starts it is missing. Its value may serve the
    tick that follows, see `Ahead`.
    """

    def __init__(
        self,
        inputs: Sequence[str],
        fire: Callable[..., None],
        depth: int = 32,
        ahead: Ahead | None = None,
    ):
        """inputs: names, in the order of the values; depth: most incomplete stamps stored."""
        self._early = ahead
        self._ahead = None if ahead is None else list(inputs).index(ahead.name)
        self._index = {name: i for i, name in enumerate(inputs)}
        self._fire = fire
        self._depth = depth
        self._open: dict[int, _Tick] = {}
        self._last = -1
        self._backlog = Backlog()
        self._dropped = 0
        self.last_seen: dict[str, int | None] = dict.fromkeys(inputs)

    def add(self, name: str, stamp: int, value: Any) -> None:
        """Add the value (not None) of input `name` for `stamp` [ns]."""
        self.last_seen[name] = stamp
        if stamp < self._last - NEW_TIME:
            self._open.clear()
            self._last = -1
        if stamp <= self._last:
            self._dropped += 1
            return
        tick = self._open.get(stamp)
        if tick is None:
            tick = self._open[stamp] = _Tick(len(self._index))
            if len(self._open) > self._depth:
                self._dropped += self._is_tick(self._open.pop(min(self._open)))
        place = self._index[name]
        tick.missing -= tick.values[place] is None
        tick.values[place] = value
        self._put_if_complete(stamp)
        if place == self._ahead and len(self._open) > 1:  # it may serve a tick of another stamp
            for other in sorted(self._open):
                self._put_if_complete(other)

    def _put_if_complete(self, stamp: int) -> None:
        tick = self._open.get(stamp)
        if tick is None:
            return
        if tick.missing:
            served = self._served(stamp, tick)
            if served is None:
                return
            tick.values[self._ahead] = served
            tick.missing = 0
        self._dropped += self._close(stamp) - 1  # all but this one
        self._backlog.put((stamp, tick.values))

    def _served(self, stamp: int, tick: _Tick) -> Any:
        """Take what the input `ahead` has for the tick `stamp` under another stamp, or None.

        None also if another input is missing.
        """
        early = self._early
        if early is None or tick.missing > 1 or tick.values[self._ahead] is not None:
            return None
        ticks = [key for key, others in self._open.items() if self._is_tick(others)]
        before = max([self._last, *(key for key in ticks if key < stamp)])
        for key in self._open.keys() - ticks:
            if early.serves(key, before, stamp):
                return early.later(self._open.pop(key).values[self._ahead], stamp - key)
        return None

    def _close(self, stamp: int) -> int:
        """Remove the ticks up to `stamp` [ns]; return their number."""
        self._last = stamp
        closed = [key for key in self._open if key <= stamp]
        return sum(self._is_tick(self._open.pop(old)) for old in closed)

    def _is_tick(self, tick: _Tick) -> bool:
        """Return whether more than the input of `ahead` has arrived."""
        early = self._ahead is not None and tick.values[self._ahead] is not None
        return len(tick.values) - tick.missing > early

    def settle(self) -> None:
        """Fire the complete ticks of the backlog."""
        for stamp, values in self._backlog.take():
            self._fire(stamp, *values)

    def skip(self, stamp: int) -> None:
        """Drop all ticks up to `stamp` [ns]."""
        if stamp > self._last:
            self._dropped += self._close(stamp)

    @property
    def dropped(self) -> int:
        """Return the number of dropped ticks and values."""
        return self._dropped + self._backlog.dropped

    def incomplete_after(self, name: str) -> bool:
        """Return whether the newest tick of input `name` still lacks other inputs."""
        return self.last_seen.get(name) in self._open
