"""A stage of the tick: its function in Python, its compiled step, and loops over compiled steps.

A compiled step does the same on the same memory. Where something is to be decided it changes
nothing and says so; then the function in Python does the stage.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from uam_control.maths.compiled import active, borrowing, inlined, prepared
from uam_control.maths.kept_tuple import KeptTuple, calling

# what a compiled step says. DECIDE: it has changed nothing; ENDED: the tick has no state; ASK: it
# is done, and the next stage comes after a question to the objects
DONE, DECIDE, ENDED, ASK = OUTCOMES = range(4)
MANY = len(OUTCOMES)


class Step(NamedTuple):
    """A function under `compiled.borrowing`, of one tuple of arrays, which says one of OUTCOMES."""

    function: Callable[[tuple], int]
    arrays: tuple


class Stage(NamedTuple):
    """run(tick): the stage in Python; it returns whether the tick goes on. step(tick): its compiled
    step, None while the objects of the tick have none. decides: whether the stage in Python may
    change what mission or autopilot do next, by more than its signals."""

    name: str
    run: Callable[[Any], bool]
    step: Callable[[Any], Step | None] = lambda tick: None
    decides: bool = True


class Steps:
    """Compiled steps in a row. `calls`: each of them, None where there is none."""

    def __init__(self, steps: Sequence[Step | None], last: Step) -> None:
        """last: is asked after the last one whether further ticks may follow, DONE."""
        self._kept = [step and KeptTuple(step.arrays) for step in (*steps, last)]
        self._functions = [
            step and calling(step.function, kept.read, 0)
            for step, kept in zip((*steps, last), self._kept, strict=True)
        ]
        self.calls = [
            step and partial(prepared(step, 0), kept.address)
            for step, kept in zip(self._functions, self._kept, strict=True)
        ]

    @property
    def whole(self) -> bool:
        """Whether every step is compiled."""
        return None not in self._functions

    def loop(self, begin: int) -> tuple[Callable[[int, bool], tuple[int, int]], bool]:
        """Return the loop over all steps, see `looped`, and whether it is compiled already; begin:
        number of the first step of its second half."""
        *steps, last = self._functions
        addresses = np.array([kept.address for kept in self._kept])
        loop = looped(_chain(steps[:begin]), _chain(steps[begin:]), last)
        ready = not active() or loop._cache.filled
        halves = addresses[:begin], addresses[begin:-1], addresses.item(-1)
        return partial(prepared(loop, *halves, 0, True), *halves), ready


def _chain(steps: Sequence[Callable[[int], int]]) -> Callable:
    rest = nothing
    for step in reversed(steps):
        rest = chained(step, rest)
    return rest


@inlined
def nothing(addresses: np.ndarray, place: int) -> int:
    """Do nothing."""
    return 0


@cache
def chained(first: Callable, rest: Callable) -> Callable:
    """Return the function that calls `first` with the address at `place`, then `rest` likewise.

    It returns 0, or the outcome of a step that is not DONE + MANY for each step before it.
    """

    @inlined
    def both(addresses: np.ndarray, place: int) -> int:
        outcome = first(addresses[place])
        if outcome != DONE:
            return outcome
        later = rest(addresses, place + 1)
        return later + MANY if later else 0

    return both


@cache
def looped(first: Callable, second: Callable, last: Callable) -> Callable:
    """Return the compiled loop over ticks of two halves, see `chained`; last: see `Steps`."""

    @borrowing
    def loop(
        ahead: np.ndarray, behind: np.ndarray, question: int, count: int, whole: bool
    ) -> tuple[int, int]:
        """Begin up to `count` ticks and end them; not whole: the first one with its second half.

        Returns the number of ticks that ended, and 0, or where the loop ended: as `chained`, with a
        minus in the second half.
        """
        done = 0
        while True:
            if whole:
                if count == 0:
                    return done, 0
                count -= 1
                end = first(ahead, 0)
                if end:
                    return done, end
            whole = True
            end = second(behind, 0)
            if end:
                return done, -end
            done += 1
            if last(question) != DONE:
                return done, 0

    return loop
