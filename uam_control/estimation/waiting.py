"""Samples by their stamps: those that wait for their turn, and the past of an estimate."""

import numpy as np

from uam_control.maths.compiled import jit

OLDEST_MATCH = 0.02  # s, largest distance in time between a sample and a value it is compared with
SAME = 1e-6  # s, between stamps of the same moment: the unit of MAVLink


@jit
def insert(
    queue: np.ndarray, count: int, stamp: float, first: np.ndarray, second: np.ndarray
) -> int:
    """Let a sample of `stamp` [s] wait among `count`; return how many wait.

    queue (m, w): in a row the stamp of a sample and its two vectors; w = 1 + len(first) +
    len(second). Equal stamps stay in order of arrival. If full, it forgets its oldest.
    """
    if count == len(queue):
        count = drop_first(queue, count)
    place, middle = count, 1 + len(first)
    while place and queue[place - 1, 0] > stamp:
        queue[place] = queue[place - 1]
        place -= 1
    queue[place, 0] = stamp
    queue[place, 1:middle] = first
    queue[place, middle:] = second
    return count + 1


@jit
def drop_first(queue: np.ndarray, count: int) -> int:
    """Forget the oldest of the `count` samples that wait; return how many are left."""
    for i in range(1, count):
        queue[i - 1] = queue[i]
    return count - 1


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
