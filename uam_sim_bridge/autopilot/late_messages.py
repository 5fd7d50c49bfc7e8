"""Messages to the autopilot that are on their way, in a ring of arrays. None overtakes another."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Number, record

WAITING, VALUES = 256, 8
# poses: stamp [s], position [m, ENU], quaternion [w x y z]; body rates [rad/s, FRD] and thrust;
# others: functions of Python that deliver them
POSE, RATES, OTHER = range(3)


class LateArrays(NamedTuple):
    """The messages that wait, in a ring."""

    due: np.ndarray  # (WAITING,) [s]
    kinds: np.ndarray  # (WAITING,)
    values: np.ndarray  # (WAITING, VALUES)
    numbers: np.ndarray  # (1,) first row of the ring, count, and how many of them are OTHER


class LateMessages:
    """The messages that have not arrived; `arrays`: never replaced. `count`, `others`: of them."""

    first, count, others = Number(), Number(), Number()

    def __init__(self) -> None:
        self.memory = record("first count others")
        kinds = np.zeros(WAITING, dtype=np.int64)
        self.arrays = LateArrays(np.zeros(WAITING), kinds, np.zeros((WAITING, VALUES)), self.memory)
        self._functions: deque[Callable[[], object]] = deque()
        self._push = bound(push, self.arrays, 0.0, 0, np.zeros(VALUES))
        self._arrives, self._take = bound(arrives, self.arrays, 0.0), bound(take, self.arrays)

    def send(self, due: float, kind: int, content: Any) -> None:
        """Let a message arrive at `due` [s]; content: values of a POSE or RATES, or for OTHER the
        function that delivers it."""
        row = np.zeros(VALUES)
        if kind == OTHER:
            self._functions.append(content)
        else:
            row[: len(content)] = content
        self._push(due, kind, row)

    def arrive(self, time: float, deliver: dict[int, Callable[[Any], object]]) -> None:
        """Deliver what is due at `time` [s]; deliver: by kind, takes the content."""
        kinds, values = self.arrays.kinds, self.arrays.values
        while self._arrives(time):
            row = self._take()
            kind = kinds.item(row)
            deliver[kind](self._functions.popleft() if kind == OTHER else values[row].copy())


@borrowing
def push(a: LateArrays, due: float, kind: int, values: np.ndarray) -> None:
    """Send a message; of more than WAITING the newest takes the place of the one before."""
    m = a.numbers[0]
    m.count = min(m.count + 1, WAITING)
    row = (m.first + m.count - 1) % WAITING
    a.due[row], a.kinds[row] = due, kind
    for i in range(len(values)):
        a.values[row, i] = values[i]
    m.others += kind == OTHER


@borrowing
def arrives(a: LateArrays, time: float) -> bool:
    """Return whether the next message arrives by `time` [s]."""
    m = a.numbers[0]
    return m.count > 0 and a.due[m.first] <= time + 1e-9


@borrowing
def take(a: LateArrays) -> int:
    """Take the next message; return its row, which is valid until WAITING more are sent."""
    m = a.numbers[0]
    row = m.first
    m.first, m.count = (row + 1) % WAITING, m.count - 1
    m.others -= a.kinds[row] == OTHER
    return row
