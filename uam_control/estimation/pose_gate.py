"""Rejects mocap poses that jump away from the estimate: exchanged axes, a moved origin, or another
body taken for the vehicle.

The gate detects jumps only. The estimate follows wrong poses that drift slowly; then the return to
the true pose is the jump and must not be rejected. In that case motion capture and IMU contradict
each other, and the estimated accelerometer bias is large: the gate then accepts all poses.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.ages import REJECTED, UNAIDED
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import Number, record

CONTRADICTED = 1.0  # m/s^2, accelerometer bias larger than that of any real accelerometer
MEMORY = 1.0  # s, no rejection for this time after such a bias or gap
# stamps [s]; rejecting_since: NaN while no pose is rejected
REAL = "distance suspended last interrupted rejecting_since"


class PoseGate:
    """Decides for each pose whether to reject it; `refused`: number of rejected poses."""

    refused, distance = Number(), Number()

    def __init__(self, distance: float) -> None:
        """distance [m]: from the estimate, above which a pose is rejected."""
        self.memory = record("refused", REAL)
        self.distance = distance
        forget_rejections(self.memory)

    def __call__(self, stamp: float, distance: float, bias: float) -> bool:
        """See `rejects`."""
        return rejects(self.memory, stamp, distance, bias, REJECTED)

    def suspend(self, stamp: float) -> None:
        """See `suspend`."""
        suspend(self.memory, stamp)

    def settled(self, stamp: float) -> bool:
        """See `settled`."""
        return settled(self.memory, stamp)


@borrowing
def forget_rejections(gate: np.ndarray) -> None:
    """Begin anew; gate (1,): memory of a `PoseGate`."""
    m = gate[0]
    m.refused = 0
    m.suspended = m.last = m.interrupted = -math.inf
    m.rejecting_since = math.nan


@borrowing
def rejects(gate: np.ndarray, stamp: float, distance: float, bias: float, longest: float) -> bool:
    """Return whether to reject the pose at `stamp` [s]; gate: see `forget_rejections`.

    distance [m]: between the pose and the estimate at its stamp; bias [m/s^2]: norm of the
    estimated accelerometer bias; longest [s]: of a rejection.
    """
    m = gate[0]
    if stamp - m.last > UNAIDED:
        suspend(gate, stamp)
    elif math.isnan(m.rejecting_since) and bias > CONTRADICTED:
        m.suspended = stamp
    m.last = stamp
    trusted = stamp - m.suspended > MEMORY
    if not (distance > m.distance and trusted):
        m.rejecting_since = math.nan
        return False
    if math.isnan(m.rejecting_since):
        m.rejecting_since = stamp
    if stamp - m.rejecting_since > longest:
        m.rejecting_since = math.nan
        suspend(gate, stamp)
        return False
    m.refused += 1
    return True


@borrowing
def suspend(gate: np.ndarray, stamp: float) -> None:
    """Reject no pose for MEMORY from `stamp` [s] on: the estimate may have a large error."""
    m = gate[0]
    m.suspended = m.interrupted = stamp


@borrowing
def settled(gate: np.ndarray, stamp: float) -> bool:
    """Return whether the estimate at `stamp` [s] has recovered from the last interruption.

    Until then the estimated biases change fast, by the return of the poses alone.
    """
    return stamp - gate[0].interrupted > MEMORY
