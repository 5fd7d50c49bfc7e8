"""The items that are handed out and not yet finished: few at a time, for each worker some."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

PER_WORKER = 3  # one that is computed, and two that need no further message to begin
LOST_AT_MOST = 20  # workers that one item may lose; after that the item itself is the cause


class Window:
    """Items in their order. An item is drawn from `items` only when there is room for it."""

    def __init__(self, items: Iterable[Any], per_worker: int = PER_WORKER) -> None:
        self._source: Iterator[tuple[int, Any]] = enumerate(items)
        self._per_worker = per_worker
        self._out: dict[int, Any] = {}
        self._again: list[int] = []
        self._losses: dict[int, int] = {}

    def __len__(self) -> int:
        """Return the number of items that are handed out, or have to be handed out again."""
        return len(self._out)

    def fill(self, workers: int) -> list[tuple[int, Any]]:
        """Return the numbered items to hand out now; lost ones come first.

        workers: present number; with none, as many items as one worker needs wait for the first.
        """
        found = [(number, self._out[number]) for number in self._again]
        self._again.clear()
        while len(self._out) < self._per_worker * max(workers, 1):
            entry = next(self._source, None)
            if entry is None:
                break
            self._out[entry[0]] = entry[1]
            found.append(entry)
        return found

    def done(self, number: int) -> None:
        """Take the item out of the window."""
        del self._out[number]
        self._losses.pop(number, None)

    def lost(self, number: int) -> bool:
        """Note that the item's worker was lost; return whether it is handed out again."""
        self._losses[number] = self._losses.get(number, 0) + 1
        if self._losses[number] > LOST_AT_MOST:
            return False
        self._again.append(number)
        return True
