"""Motions from one state to rest: to a goal, or from beside the path back to it."""

import numpy as np

from uam_control.coordinates import CHI, CHI_DOT, JERK, SNAP
from uam_control.mission.motion.polynomials import hermite, quintic, quintic_at


class Segment:
    """Quintic polynomials from a motion to rest at a goal, one duration per coordinate."""

    def __init__(
        self,
        stamp: float,
        start: np.ndarray,
        goal: np.ndarray,
        lengths: np.ndarray,
        columns: slice = slice(None),
    ) -> None:
        """Begin at `stamp` [s] at start (3, 6 + n) or (5, 6 + n); end at goal (6 + n,), after
        lengths (6 + n,) [s]; columns: those that move.
        """
        self._stamp, self._columns = stamp, columns
        self._lengths, self._goal = lengths[columns], goal[columns].copy()
        start = start[:, columns]
        rest = np.zeros_like(start)
        rest[CHI] = self._goal
        self._powers = quintic(start, rest, self._lengths)

    @property
    def end(self) -> float:
        """Return the stamp [s] at which all coordinates are at rest."""
        return self._stamp + float(np.max(self._lengths))

    def write(self, stamp: float, motion: np.ndarray) -> None:
        """Write the motion (5, 6 + n) at `stamp` [s]."""
        motion = motion[:, self._columns]
        u = np.clip((stamp - self._stamp) / self._lengths, 0.0, 1.0)
        motion[:] = quintic_at(self._powers, u, self._lengths)
        arrived = u >= 1.0  # without rounding errors
        motion[CHI, arrived] = self._goal[arrived]
        motion[CHI_DOT:, arrived] = 0.0


class WayBack:
    """Offset from the path that decays to zero, with no step in value, rate or acceleration.

    From rest the jerk has no step either.

    `end` [s]: stamp at which it is zero. PEAK, HARDEST: from rest, largest rate and acceleration,
    times length / way and length^2 / way.
    """

    PEAK, HARDEST = 35.0 / 16.0, 7.5132

    def __init__(self, stamp: float, offset: np.ndarray, length: float) -> None:
        """Begin at `stamp` [s] with offset (5, 6 + n); end at rest after `length` [s]."""
        rows = np.zeros((SNAP, 2, offset.shape[1]))
        rows[:JERK, 0] = offset[:JERK]  # a jerk at the start would grow with the cube of the length
        self._stamp, self.end = stamp, stamp + length
        self._curve = hermite(np.array([0.0, length]), rows)

    def write(self, stamp: float, motion: np.ndarray) -> None:
        """Write the offset (5, 6 + n) at `stamp` [s]."""
        self._curve.write(stamp - self._stamp, motion)
