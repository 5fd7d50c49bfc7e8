"""A wait in lockstep: told by name after some seconds, and over when nothing can come any more.

How long a node takes depends on the machine, so no wall time ends a wait. Every node takes its
messages and reports in /diagnostics once a second. If all have done so REPORTS times since the wait
began and an answer is still missing, a message was lost, or a node answers nothing. A process that
has ended or is stopped reports nothing; `uam fly` finds it by its state.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection

from uam_msgs_py.node.connections import Connections

REPORTS = 10  # of each node; a tick needs one round of each of six nodes
SAY_AFTER = 3.0  # [s] of wall time until a wait is told


class Awaited:
    """One wait at a time: `begin`, then `told` and `lost` while it lasts."""

    def __init__(
        self, reported: Connections, nodes: Collection[str], tell: Callable[[str], None]
    ) -> None:
        """reported: of the nodes; nodes: those that a tick needs; tell: called with whom the plant
        waits for, at most once a second."""
        self._reported, self._nodes, self._tell = reported, nodes, tell
        self.begin()

    def begin(self) -> None:
        """Begin a wait."""
        self._begun = time.monotonic()
        self._before: list[int] = []  # reports when it was told

    def told(self, whom: Callable[[], str]) -> None:
        """Tell whom the plant waits for, if it has waited for SAY_AFTER."""
        if time.monotonic() - self._begun > SAY_AFTER:
            self._before = self._before or self._counts()
            self._tell(whom())

    @property
    def lost(self) -> bool:
        """Whether every node has reported often enough since the wait was told."""
        before = self._before
        return bool(before) and all(
            now - then >= REPORTS for now, then in zip(self._counts(), before, strict=True)
        )

    def _counts(self) -> list[int]:
        return [self._reported.reports(node) for node in self._nodes]
