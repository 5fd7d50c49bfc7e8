"""While a lost node is being started again, the plant in lockstep does not wait for its answers."""

from __future__ import annotations

from uam_sim_bridge.patience import Patience

IN_TIME = 25  # complete ticks in a row, after which everyone is there again


class Restart:
    """`going_on`: whether ticks go on without answers that do not come in time."""

    def __init__(self, longest: float) -> None:
        """longest [s of wall time]: after a restart was announced."""
        self._longest = longest
        self._seen = self._complete = 0
        self._patience: Patience | None = None

    @property
    def going_on(self) -> bool:
        """Not longer than allowed, and until everyone is there again."""
        return self._patience is not None and not self._patience.over

    def look(self, announced: int) -> None:
        """Take note of how many restarts were announced so far."""
        if announced > self._seen:
            self._seen, self._complete = announced, 0
            self._patience = Patience(self._longest)

    def tick(self, complete: bool) -> None:
        """Note a tick, and whether all answers came in time."""
        if self._patience is not None:
            self._complete = self._complete + 1 if complete else 0
            if self._complete >= IN_TIME:
                self._patience = None
