"""A reference is published one tick ahead: which tick it serves, and its values there.

At a tick the mission publishes one reference, for the stamp one control period later. The next tick
has another stamp if an IMU sample is missing or the IMU's clock drifts. This reference serves it
too, carried on by its own rates; the error is of third order in the difference.
"""

from __future__ import annotations

import numpy as np

from uam_control.stages.tick_stamps import LONG
from uam_control.stamps import SECOND


def serves(reference: int, before: int, stamp: int, period: int) -> bool:
    """Return whether the reference of a stamp serves the tick `stamp`; all in [ns].

    before: stamp of the tick before, -1 without one. period: control period. After LONG periods
    without a tick nothing that was published before is used.
    """
    recent = 0 <= before < stamp <= before + LONG * period
    return recent and before < reference < stamp + period // 2


def carried(reference: np.ndarray, step: int) -> np.ndarray:
    """Return the reference (3, 6 + n) chi_d, chi_d_dot, chi_d_ddot, `step` [ns] later."""
    dt = step / SECOND
    value, rate, bend = reference
    return np.array([value + dt * rate + 0.5 * dt * dt * bend, rate + dt * bend, bend])
