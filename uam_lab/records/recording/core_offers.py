"""Offers the core to other processes during long work.

A poll of the recorder takes some milliseconds. A process that the flight waits for, and that
becomes ready meanwhile on the same core, often waits for the end of the poll: the scheduler of
Linux lets a running process finish its slice. One that gives up the core has to wait for others in
turn, on a busy computer for many milliseconds. So a poll offers nothing more after a long wait.
"""

from __future__ import annotations

import os
import time

AT_ONCE = 4  # messages between two offers
LONG = 0.002  # [s] a tick's process computes for less than this


class CoreOffers:
    """Call `begin` at the begin of a poll, then `after` each message."""

    def __init__(self) -> None:
        self._offering = True

    def begin(self) -> None:
        """Begin a poll: offer again."""
        self._offering = True

    def after(self, number: int) -> None:
        """Offer the core if `number` messages are a multiple of AT_ONCE."""
        if number % AT_ONCE or not self._offering:
            return
        begun = time.perf_counter()
        os.sched_yield()
        self._offering = time.perf_counter() - begun < LONG
