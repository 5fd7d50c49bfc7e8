"""Detection of a frozen tracker: it repeats its last pose exactly, without noise."""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import borrowing, prepared

POSITION, POSE = 3, 7


class Repeats:
    """Compares each pose with the last one; newest (7,): position and quaternion of that."""

    def __init__(self) -> None:
        self.newest = np.full(POSE, math.nan)
        still, level = np.zeros(3), np.zeros(4)
        self._repeated = prepared(repeated, still, level, self.newest)

    def __call__(self, position: np.ndarray, quaternion: np.ndarray) -> bool:
        """Return whether position (3,) and quaternion (4,) equal those of the last call exactly."""
        return self._repeated(position, quaternion, self.newest)


@borrowing
def repeated(position: np.ndarray, quaternion: np.ndarray, newest: np.ndarray) -> bool:
    """Return whether position (3,) and quaternion (4,) equal newest (7,) exactly; keep them there.

    0 and -0 differ, as in their bytes.
    """
    same = True
    for i in range(POSE):
        value = position[i] if i < POSITION else quaternion[i - POSITION]
        before = newest[i]
        if value != before or math.copysign(1.0, value) != math.copysign(1.0, before):
            same = False
        newest[i] = value
    return same
