"""A slow shift of the path: the reference follows the path beside it."""

from __future__ import annotations

import numpy as np

from uam_control.coordinates import CHI, MOTION_ROWS, POSITION
from uam_control.mission.motion.segments import Segment
from uam_control.mission.plans import PEAK

SPEED = 0.05  # [m/s] peak speed of a change
SHORTEST = 1.0  # [s] of a change


class Shift:
    """Shift (3,) [m] of the positions of a path, with its rates; constant after each change."""

    def __init__(self) -> None:
        self._values = np.zeros((MOTION_ROWS, 3))
        self._goal = np.zeros(3)
        self._aimed: np.ndarray | None = None  # the array of the last change
        self._beside = False  # whether the goal is not zero
        self._segment: Segment | None = None

    def aim(self, stamp: float, goal: np.ndarray) -> None:
        """Change to `goal` (3,) [m] from `stamp` [s] on; no effect if that is the goal already.

        The array must not change afterwards.
        """
        if goal is self._aimed or np.array_equal(goal, self._goal):
            return
        self._aimed, self._goal, self._beside = goal, goal.copy(), bool(goal.any())
        way = float(np.max(np.abs(goal - self._values[CHI])))
        length = max(SHORTEST, PEAK * way / SPEED)
        self._segment = Segment(stamp, self._values, goal, np.full(3, length))

    @property
    def settled(self) -> bool:
        """Return whether no change is under way."""
        return self._segment is None

    @property
    def value(self) -> np.ndarray:
        """Return the present shift (3,) [m]; read only."""
        return self._values[CHI]

    def advance(self, stamp: float) -> None:
        """Set the shift for `stamp` [s]; call it before `add`."""
        if self._segment is not None:
            self._segment.write(stamp, self._values)
            if stamp >= self._segment.end:
                self._segment = None

    def add(self, motion: np.ndarray) -> None:
        """Add the shift to the positions of a motion (5, 6 + n)."""
        if self._beside or self._segment is not None:
            motion[:, POSITION] += self._values
