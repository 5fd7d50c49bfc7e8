"""Joins the messages of several topics that carry the same stamp.

Never by order of arrival: between processes that order is chance, and a lockstep flight must be the
same to the last bit.
"""

from collections.abc import Callable, Sequence
from typing import Any

BACKLOG = 3  # [ticks] as many control periods as a setpoint may be late, see mujoco_sim


class Backlog:
    """Ticks that have arrived and wait to be worked on.

    Who is a little behind works off all of them, in order. Who is far behind goes on with the
    newest: working off a long backlog would only keep the delay.
    """

    def __init__(self):
        self._items: list[Any] = []
        self.dropped = 0

    def put(self, item: Any) -> None:
        """Add the newest tick."""
        self._items.append(item)

    def take(self) -> list[Any]:
        """Return what is to be worked on now, in order."""
        items = self._items
        if not items:
            return items
        self._items = []
        if len(items) <= BACKLOG:
            return items
        self.dropped += len(items) - 1
        return items[-1:]


class StampJoin:
    """Calls `fire(stamp, *values)` once every input has delivered its value for a stamp.

    Ticks fire in the order of their stamps. When one fires, older incomplete ones can no longer
    matter; they are dropped and counted, as is whatever arrives for them later.

    deferred: `settle` fires, once all that has arrived has been added, see `Backlog`.
    """

    def __init__(self, inputs: Sequence[str], fire: Callable[..., None], depth: int = 32):
        """inputs: names, in the order of the values; depth: incomplete stamps kept at most."""
        self._index = {name: i for i, name in enumerate(inputs)}
        self._fire = fire
        self._depth = depth
        self._open: dict[int, list[Any]] = {}
        self._last = -1
        self._backlog = Backlog()
        self.deferred = False
        self.fired = 0
        self._dropped = 0
        self.last_seen: dict[str, int | None] = dict.fromkeys(inputs)

    def add(self, name: str, stamp: int, value: Any) -> None:
        """Take the value of input `name` for `stamp` [ns]; may fire. None is not a value."""
        self.last_seen[name] = stamp
        if stamp <= self._last:
            self._dropped += 1
            return
        values = self._open.get(stamp)
        if values is None:
            values = self._open[stamp] = [None] * len(self._index)
            if len(self._open) > self._depth:
                del self._open[min(self._open)]
                self._dropped += 1
        values[self._index[name]] = value
        if any(value is None for value in values):
            return
        self._dropped += self._close(stamp) - 1  # all but this one
        self._backlog.put((stamp, values))
        if not self.deferred:
            self.settle()

    def _close(self, stamp: int) -> int:
        """Let go of the ticks up to `stamp` [ns]; return how many were open."""
        self._last = stamp
        closed = [key for key in self._open if key <= stamp]
        for old in closed:
            del self._open[old]
        return len(closed)

    def settle(self) -> None:
        """Where `deferred`: fire what is complete."""
        for stamp, values in self._backlog.take():
            self.fired += 1
            self._fire(stamp, *values)

    def skip(self, stamp: int) -> None:
        """Let nothing up to `stamp` [ns] fire any more."""
        if stamp > self._last:
            self._dropped += self._close(stamp)

    @property
    def dropped(self) -> int:
        """Ticks and values that came to nothing."""
        return self._dropped + self._backlog.dropped

    def incomplete_after(self, name: str) -> bool:
        """Whether input `name` has delivered a stamp that still lacks others."""
        return self.last_seen.get(name) in self._open

    @property
    def waiting_for(self) -> list[str]:
        """Inputs that have never arrived."""
        return [name for name, stamp in self.last_seen.items() if stamp is None]
