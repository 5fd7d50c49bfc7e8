"""A tracker whose poses jump away from an estimate that agreed with them: axes or origin changed,
another body taken for the vehicle.

Only a jump is to be told from the truth. Where poses lead the estimate away little by little, they
are what it is made of, and what jumps is the way back: motion capture and IMU contradict each other
then, which the bias that explains the difference shows.
"""

from __future__ import annotations

import math

CONTRADICTED = 1.0  # [m/s^2] bias of the accelerometer that no accelerometer has
GAP = 0.5  # [s] without poses, after which the estimate may be off
MEMORY = 1.0  # [s] for which the estimate is not trusted after such a bias, or a gap
LONGEST = 2.0  # [s] after which poses are used again, as the estimate is worse by then


class PoseGate:
    """Tells of each pose whether it is not to be used; `refused`: how many were not."""

    def __init__(self, distance: float) -> None:
        """distance [m]: from the estimate, from which on a pose is not used."""
        self.distance = distance
        self.refused = 0
        self._doubted = self._last = -math.inf  # stamps [s]
        self._closed: float | None = None

    def __call__(self, stamp: float, distance: float, bias: float) -> bool:
        """Whether to refuse a pose of `stamp` [s], `distance` [m] from the estimate of its time.

        bias [m/s^2]: of the accelerometer, as estimated.
        """
        if stamp - self._last > GAP or (self._closed is None and bias > CONTRADICTED):
            self.doubt(stamp)
        self._last = stamp
        trusted = stamp - self._doubted > MEMORY
        if not (distance > self.distance and trusted):
            self._closed = None
            return False
        if self._closed is None:
            self._closed = stamp
        if stamp - self._closed > LONGEST:
            self._closed = None
            self.doubt(stamp)
            return False
        self.refused += 1
        return True

    def doubt(self, stamp: float) -> None:
        """Note at `stamp` [s] that the estimate may be off: for a while no pose is refused."""
        self._doubted = stamp
