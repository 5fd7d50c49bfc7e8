"""A stage of the tick: its function in Python, its compiled step, and a loop over stages.

A compiled step does the same on the same memory. Where something is to be decided it changes
nothing and says so; then the function in Python does the stage.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing, prepared
from uam_control.maths.kept_tuple import Hook, call, compiled_hook, python_hook, table

# what a compiled step says. DECIDE: it has changed nothing; ENDED: the tick has no state; ASK: it
# is done, and the next stage comes after a question to the objects
DONE, DECIDE, ENDED, ASK = OUTCOMES = range(4)
MANY = len(OUTCOMES)


class Step(NamedTuple):
    """A function under `compiled.borrowing`, of one tuple of arrays, which says one of OUTCOMES."""

    function: Callable[[tuple], int]
    arrays: tuple


class Stage(NamedTuple):
    """A part of a tick, in Python and compiled."""

    name: str
    run: Callable[[Any], bool]  # in Python; whether the tick goes on
    step: Callable[[Any], Step | None] = lambda tick: None  # compiled, if there is one now
    decides: bool = True  # run may change what mission or autopilot do next, by more than signals


class Steps:
    """A loop over parts of a tick: compiled steps, and functions in Python that say one of OUTCOMES
    and do not raise."""

    def __init__(
        self, parts: Sequence[Step | Callable[[], int]], begin: int, last: Step | Callable[[], int]
    ) -> None:
        """begin: number of the first part of the second half of a tick; last: is asked after each
        tick whether further ones may follow, DONE."""
        self._kept = [_hook(part) for part in (*parts, last)]
        hooks = table(self._kept)
        halves = hooks[:begin], hooks[begin:-1], hooks[-1]
        self._loop = partial(prepared(loop, *halves, 0, True), *halves)

    def __call__(self, count: int, whole: bool) -> tuple[int, int]:
        """Begin up to `count` ticks and end them; not whole: the first one with its second half.

        Returns the number of ticks that ended, and 0, or where the loop ended: the outcome of a
        part that is not DONE + MANY for each part before it in its half, with a minus in the second
        half.
        """
        return self._loop(count, whole)


def _hook(part: Step | Callable[[], int]) -> Hook:
    return compiled_hook(*part) if isinstance(part, Step) else python_hook(part)


@borrowing
def chain(hooks: np.ndarray) -> int:
    """Do parts one after another; return 0, or where they ended, see `Steps`."""
    for i in range(len(hooks)):
        outcome = call(hooks[i, 0], hooks[i, 1])
        if outcome != DONE:
            return outcome + MANY * i
    return 0


@borrowing
def loop(
    ahead: np.ndarray, behind: np.ndarray, question: np.ndarray, count: int, whole: bool
) -> tuple[int, int]:
    """Do ticks of two halves; see `Steps`."""
    done = 0
    while True:
        if whole:
            if count == 0:
                return done, 0
            count -= 1
            end = chain(ahead)
            if end:
                return done, end
        whole = True
        end = chain(behind)
        if end:
            return done, -end
        done += 1
        if call(question[0], question[1]) != DONE:
            return done, 0
