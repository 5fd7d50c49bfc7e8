"""Answers that are overdue: which answer belongs to which instruction.

Protocol 2.0 has one answer per instruction, without a number. An answer that is given up may still
come: after a stall it lies in front of the answer to the next instruction, and would be taken for
it. A servo answers in the order of its instructions, so the oldest overdue one comes first.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

LATEST = 1.0  # [s] an answer comes within this time, or it is lost


@dataclass(frozen=True)
class Instruction:
    """An instruction to one servo; parameters: as sent; size: bytes of data in its answer."""

    servo: int
    code: int
    parameters: bytes
    size: int

    def packet(self) -> list[int]:
        """Return the packet for the maker's library, which fills in header, stuffing and CRC."""
        length = (len(self.parameters) + 3).to_bytes(2, "little")
        return [0, 0, 0, 0, self.servo, *length, self.code, *self.parameters, 0, 0]


class Overdue:
    """The instructions whose answers were given up in the last second; true if there are any."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """clock: seconds."""
        self._clock = clock
        self._waiting: deque[tuple[float, Instruction]] = deque()

    def __bool__(self) -> bool:
        """Return whether answers are overdue."""
        while self._waiting and self._waiting[0][0] < self._clock() - LATEST:
            self._waiting.popleft()
        return bool(self._waiting)

    def add(self, instruction: Instruction) -> None:
        """Note that the answer to `instruction` is given up."""
        self._waiting.append((self._clock(), instruction))

    def arrived(self, servo: int, data: bytes) -> set[Instruction]:
        """Return the instructions to which an answer can belong; the oldest one is then settled.

        An answer may also be lost for ever, so it need not belong to the oldest one.
        """
        if not self:
            return set()
        pairs = [p for p in self._waiting if p[1].servo == servo and p[1].size == len(data)]
        if pairs:
            self._waiting.remove(pairs[0])
        return {instruction for _, instruction in pairs}

    def answers(self, instruction: Instruction, servo: int, data: bytes, refused: bool) -> bool:
        """Return whether an answer is the one to `instruction`, the newest one.

        refused: it has an error, and then no data. An answer counts also if it can only belong to
        an equal instruction; that of the newest one is then overdue.
        """
        late = self.arrived(servo, data)
        if servo != instruction.servo:
            return False
        if not late:
            return refused or len(data) == instruction.size
        if late == {instruction}:
            self.add(instruction)
            return True
        return False
