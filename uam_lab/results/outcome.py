"""How a flight went, whichever engine flew it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from uam_control.supervision import State, StateTransition
from uam_lab.results.timeseries import Series


def transition(time: float, before: str, after: str, cause: str) -> dict[str, Any]:
    """One change of the supervisor's state, as metrics.json has it; time: mission time [s]."""
    return {"time_s": round(time, 6), "from": before, "to": after, "cause": cause}


def transitions(changes: Sequence[StateTransition]) -> list[dict[str, Any]]:
    """The supervisor's changes in mission time; from the last one where nothing took off."""
    takeoff = [change.stamp for change in changes if change.target is State.TAKING_OFF]
    begin = takeoff[0] if takeoff else changes[-1].stamp if changes else 0.0
    return [transition(c.stamp - begin, c.source.value, c.target.value, c.cause) for c in changes]


@dataclass
class Outcome:
    """What an engine hands over.

    series: None when no control tick was recorded. wall_s: from the first tick to the last.
    abort_reason: why the mission was given up. failure: why the flight could not go on, in one
    line, and `details`, the last lines of the log that tell more. latency_s, missed_ticks: realtime
    only. parameter_changes: see `log_reader.parameter_changes`; transitions: see `transition`;
    faults: see `faults.timeline.record`.
    """

    series: Series | None
    wall_s: float = 0.0
    abort_reason: str = ""
    failure: str = ""
    details: Sequence[str] = ()
    interrupted: bool = False
    latency_s: Sequence[float] | None = None
    missed_ticks: int | None = None
    notes: list[str] = field(default_factory=list)
    parameter_changes: list[dict[str, Any]] = field(default_factory=list)
    transitions: list[dict[str, Any]] = field(default_factory=list)
    faults: list[dict[str, Any]] = field(default_factory=list)

    @property
    def partial(self) -> bool:
        """Whether the recording stops before the mission was over."""
        return bool(self.failure) or self.interrupted

    @property
    def reason(self) -> str:
        """Why the mission was not completed, as far as the engine knows; "" if it does not."""
        if self.interrupted:
            return "interrupted by the user"
        return self.failure or self.abort_reason
