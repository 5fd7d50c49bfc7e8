"""Memory of a stage: named numbers, allocated once; Python and compiled functions use the same."""

import math
from typing import Any

import numpy as np

from uam_control.maths.compiled import borrowing


def record(whole: str, real: str = "", rows: int = 1) -> np.ndarray:
    """Return a structured array (rows,) of zeros; whole, real: names of its int64 and float64.

    Raises ValueError for a name that plain Python would take for an attribute of NumPy's.
    """
    taken = [name for name in f"{whole} {real}".split() if hasattr(np.record, name)]
    if taken:
        raise ValueError(f"not a name of a number: {', '.join(taken)}")
    fields = [(name, np.int64) for name in whole.split()]
    fields += [(name, np.float64) for name in real.split()]
    # fields are attributes in plain Python, too
    return np.zeros(rows, np.dtype((np.record, fields)))


def numbers(memory: np.ndarray) -> dict[str, int | float]:
    """Return the numbers of a structured array (1,) by name."""
    return dict(zip(memory.dtype.names, memory[0].item(), strict=True))


class Number:
    """A number of the object's `memory` as its attribute of the same name, or with _ before it."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name.removeprefix("_")

    def __get__(self, one: Any, owner: type) -> int | float:
        return one.memory[self._name].item()

    def __set__(self, one: Any, value: float) -> None:
        one.memory[self._name] = value


class Flag(Number):
    """A whole number of `memory` that is 0 or 1, as a bool."""

    def __get__(self, one: Any, owner: type) -> bool:
        return one.memory[self._name].item() != 0


class Known(Number):
    """A number that may be None; NaN in memory."""

    def __get__(self, one: Any, owner: type) -> float | None:
        value = super().__get__(one, owner)
        return None if math.isnan(value) else value

    def __set__(self, one: Any, value: float | None) -> None:
        super().__set__(one, math.nan if value is None else value)


@borrowing
def put(values: np.ndarray, into: np.ndarray) -> None:
    """Copy values (n,) to into (n,)."""
    for i in range(len(into)):
        into[i] = values[i]
