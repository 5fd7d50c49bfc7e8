"""What the parts share: structured arrays (1,) for their numbers, and poses that repeat."""

from __future__ import annotations

import numpy as np

from uam_control.estimation.repeats import Repeats
from uam_control.maths.compiled import borrowing


def record(whole: str, real: str) -> np.ndarray:
    """Return a structured array (1,) of zeros; whole, real: names of its int64 and float64."""
    fields = [(name, np.int64) for name in whole.split()]
    fields += [(name, np.float64) for name in real.split()]
    return np.zeros(1, np.dtype((np.record, fields)))  # fields are attributes in plain Python, too


def numbers(memory: np.ndarray) -> dict[str, int | float]:
    """Return the numbers of a structured array (1,) by name."""
    return dict(zip(memory.dtype.names, memory[0].item(), strict=True))


def load_pose(repeats: Repeats, newest: np.ndarray) -> bool:
    """Write the pose that `repeats` compares with to newest (7,); False: there is none."""
    pose = b"".join(repeats._last)
    if pose:
        newest[:] = np.frombuffer(pose)
    return bool(pose)


def store_pose(newest: np.ndarray, repeats: Repeats) -> None:
    """Let `repeats` compare the next pose with newest (7,)."""
    repeats._last = newest[:3].tobytes(), newest[3:].tobytes()


@borrowing
def put(values: np.ndarray, into: np.ndarray) -> None:
    """Copy values (n,) to into (n,)."""
    for i in range(len(into)):
        into[i] = values[i]
