"""Collection of Python's cyclic garbage between two ticks.

Python collects at any allocation, also in the middle of a tick. A node's own objects are frozen at
its start, so that a collection has only the few objects since then to look at.
"""

import gc


class GarbageCollection:
    """Takes collection over from Python. Context manager: Python collects again after the block."""

    def __init__(self, between_ticks: bool = True):
        """between_ticks: False leaves the moment to Python."""
        self._between_ticks = between_ticks

    def __enter__(self) -> "GarbageCollection":
        gc.collect()
        gc.freeze()  # excludes the existing objects from collections in flight
        if self._between_ticks:
            gc.disable()
        return self

    def __exit__(self, *exception) -> None:
        gc.enable()

    def at_rest(self) -> None:
        """Collect the oldest generation that is due, by Python's own thresholds; called at rest."""
        if not self._between_ticks:
            return
        due = [
            generation
            for generation, (count, threshold) in enumerate(
                zip(gc.get_count(), gc.get_threshold(), strict=True)
            )
            if threshold and count > threshold
        ]
        if due:
            gc.collect(due[-1])
