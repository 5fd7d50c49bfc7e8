"""Rejects mocap poses that jump away from the estimate: exchanged axes, a moved origin, or another
body taken for the vehicle.

The gate detects jumps only. The estimate follows wrong poses that drift slowly; then the return to
the true pose is the jump and must not be rejected. In that case motion capture and IMU contradict
each other, and the estimated accelerometer bias is large: the gate then accepts all poses.
"""

from __future__ import annotations

import math

from uam_control.ages import REJECTED, UNAIDED

CONTRADICTED = 1.0  # m/s^2, accelerometer bias larger than that of any real accelerometer
MEMORY = 1.0  # s, no rejection for this time after such a bias or gap


class PoseGate:
    """Decides for each pose whether to reject it; `refused`: number of rejected poses."""

    def __init__(self, distance: float) -> None:
        """distance [m]: from the estimate, above which a pose is rejected."""
        self.distance = distance
        self.refused = 0
        self._suspended = self._last = self._interrupted = -math.inf  # stamps [s]
        self._rejecting_since: float | None = None

    def __call__(self, stamp: float, distance: float, bias: float) -> bool:
        """Return whether to reject the pose at `stamp` [s].

        distance [m]: between the pose and the estimate at its stamp; bias [m/s^2]: norm of the
        estimated accelerometer bias.
        """
        if stamp - self._last > UNAIDED:
            self.suspend(stamp)
        elif self._rejecting_since is None and bias > CONTRADICTED:
            self._suspended = stamp
        self._last = stamp
        trusted = stamp - self._suspended > MEMORY
        if not (distance > self.distance and trusted):
            self._rejecting_since = None
            return False
        if self._rejecting_since is None:
            self._rejecting_since = stamp
        if stamp - self._rejecting_since > REJECTED:
            self._rejecting_since = None
            self.suspend(stamp)
            return False
        self.refused += 1
        return True

    def suspend(self, stamp: float) -> None:
        """Reject no pose for MEMORY from `stamp` [s] on: the estimate may have a large error."""
        self._suspended = self._interrupted = stamp

    def settled(self, stamp: float) -> bool:
        """Return whether the estimate at `stamp` [s] has recovered from the last interruption.

        Until then the estimated biases change fast, by the return of the poses alone.
        """
        return stamp - self._interrupted > MEMORY
