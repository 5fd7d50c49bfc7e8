"""Times of grasp and release in a scenario, derived from its moves and its magnet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol


class VerticalMove(Protocol):
    """Motion of one coordinate from `start` to `end` [s] to the value `to`."""

    coordinate: str
    start: float
    end: float
    to: float


class GraspWindow(NamedTuple):
    """Mission times [s] of one payload.

    descent: begin of the last descent before the magnet is on; grip: magnet on; lifted: end of the
    climb after it; release: magnet off; departure: begin of the next motion, at most 1 s later.
    dip [m]: height of the descent.
    """

    descent: float
    grip: float
    lifted: float
    release: float
    departure: float
    dip: float


LONGEST_FALL = 1.0  # [s] after the release, for the verification


def grasp_windows(
    moves: Sequence[VerticalMove], magnet: Sequence[tuple[float, bool]]
) -> tuple[GraspWindow, ...]:
    """Return the windows of a scenario with moves and magnet switching (time [s], on).

    A magnet that is switched on without a descent before and a climb after it has no window.
    """
    found = []
    switches = sorted(magnet)
    for i, (grip, on) in enumerate(switches):
        if not on:
            continue
        release = next((at for at, still_on in switches[i + 1 :] if not still_on), math.inf)
        vertical = sorted((m for m in moves if m.coordinate == "z"), key=lambda m: m.start)
        before = [m for m in vertical if m.end <= grip]
        after = [m for m in vertical if grip <= m.start < release]
        if len(before) < 2 or not after:
            continue
        dip, climb = before[-2].to - before[-1].to, after[0].to - before[-1].to
        if dip <= 0.0 or climb <= 0.0:
            continue
        starts = [m.start for m in moves if m.start >= release]
        departure = min([*starts, release + LONGEST_FALL])
        found.append(GraspWindow(before[-1].start, grip, after[0].end, release, departure, dip))
    return tuple(found)
