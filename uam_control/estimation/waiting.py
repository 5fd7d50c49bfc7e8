"""Samples that wait for their turn, in the order of their stamps: whatever arrives first."""

from __future__ import annotations

import numpy as np

from uam_control.maths.compiled import jit


@jit
def make_room(queue: np.ndarray, count: int, stamp: float) -> int:
    """Make room for a sample of `stamp` [s] among the `count` that wait; return its row.

    queue (m, w), m > count: the stamp of a sample first. Equal stamps stay in order of arrival.
    """
    place = count
    while place and queue[place - 1, 0] > stamp:
        queue[place] = queue[place - 1]
        place -= 1
    queue[place, 0] = stamp
    return place


@jit
def insert(
    queue: np.ndarray, count: int, stamp: float, first: np.ndarray, second: np.ndarray
) -> int:
    """Let a sample of `stamp` [s] wait, two vectors in a row; return how many wait.

    queue (m, w): see `make_room`; w = 1 + len(first) + len(second). If full, it forgets its oldest.
    """
    if count == len(queue):
        count = drop_first(queue, count)
    place, middle = make_room(queue, count, stamp), 1 + len(first)
    queue[place, 1:middle] = first
    queue[place, middle:] = second
    return count + 1


@jit
def drop_first(queue: np.ndarray, count: int) -> int:
    """Forget the oldest of the `count` samples that wait; return how many are left."""
    for i in range(1, count):
        queue[i - 1] = queue[i]
    return count - 1
