"""Lockstep without answers of a lost node while it is restarted."""

from __future__ import annotations

from uam_sim_bridge.patience import Patience

IN_TIME = 25  # complete ticks in a row after which the restart is finished


class Restart:
    """`going_on`: whether ticks go on without late answers."""

    def __init__(self, longest: float) -> None:
        """longest [s of wall time]: duration after the announcement of a restart."""
        self._longest = longest
        self._seen = self._complete = 0
        self._patience: Patience | None = None

    @property
    def going_on(self) -> bool:
        """Whether a restart goes on: neither finished nor longer than allowed."""
        return self._patience is not None and not self._patience.over

    def look(self, announced: int) -> None:
        """Register the number of restarts announced so far."""
        if announced > self._seen:
            self._seen = announced
            self.begin(self._longest)

    def begin(self, longest: float) -> None:
        """Begin a restart now, for at most `longest` [s of wall time]."""
        self._complete = 0
        self._patience = Patience(longest)

    def tick(self, complete: bool) -> None:
        """Register a tick; complete: all answers were in time."""
        if self._patience is not None:
            self._complete = self._complete + 1 if complete else 0
            if self._complete >= IN_TIME:
                self._patience = None
