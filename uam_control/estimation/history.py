"""The past of an estimate: its value at the exposure of a late sample."""

from __future__ import annotations

import numpy as np

from uam_control.maths.compiled import jit

OLDEST_MATCH = 0.02  # s, largest distance in time between a sample and a value it is compared with
SAME = 1e-6  # s, between stamps of the same moment: the unit of MAVLink


@jit
def value_at(
    stamps: np.ndarray, rows: np.ndarray, newest: int, stamp: float, found: np.ndarray
) -> tuple[float, float]:
    """Write the value of `stamp` [s] into found (w,), linear between the two rows around it.

    stamps (m,) [s], rows (m, w): a ring, written up to `newest`. Next to a gap of more than twice
    OLDEST_MATCH, and outside the ring, the nearest row counts. Returns the stamp of the value [s],
    and the time [s] between the two rows, 0 for the value of one row.
    """
    before = newest
    for _ in range(len(stamps) - 1):
        if stamps[before] <= stamp:
            break
        before = (before - 1) % len(stamps)
    after = before if before == newest else (before + 1) % len(stamps)
    gap, since = stamps[after] - stamps[before], stamp - stamps[before]
    if SAME < since < gap - SAME and gap <= 2.0 * OLDEST_MATCH:
        share = since / gap
        for i in range(len(found)):
            found[i] = rows[before, i] + share * (rows[after, i] - rows[before, i])
        return stamp, gap
    nearest = after if abs(stamps[after] - stamp) < abs(since) else before
    for i in range(len(found)):
        found[i] = rows[nearest, i]
    return stamps[nearest], 0.0
