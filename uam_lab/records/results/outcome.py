"""Result of a flight, the same for both engines, and what completes its result folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from uam_control.grasp import GraspDecision
from uam_control.supervision import State, StateTransition
from uam_lab.records.results import metrics
from uam_lab.records.results.result_folder import ResultFolder, write_json
from uam_lab.records.results.timeseries import Series


def transition(time: float, before: str, after: str, cause: str) -> dict[str, Any]:
    """Return one change of the supervisor's state for metrics.json; time: mission time [s]."""
    return {"time_s": round(time, 6), "from": before, "to": after, "cause": cause}


def transitions(changes: Sequence[StateTransition]) -> list[dict[str, Any]]:
    """Return the supervisor's state changes in mission time.

    Without a take-off the time counts from the last change.
    """
    takeoff = [change.stamp for change in changes if change.target is State.TAKING_OFF]
    begin = takeoff[0] if takeoff else changes[-1].stamp if changes else 0.0
    return [transition(c.stamp - begin, c.source.value, c.target.value, c.cause) for c in changes]


def grasp_decision(time: float, grasp: str, attempt: int, text: str) -> dict[str, Any]:
    """Return one decision about the payload for metrics.json; time: mission time [s]."""
    return {"time_s": round(time, 6), "grasp": grasp, "attempt": attempt, "text": text}


def grasp_decisions(
    decisions: Sequence[GraspDecision], changes: Sequence[StateTransition]
) -> list[dict[str, Any]]:
    """Return the decisions about the payload in mission time; changes: of the supervisor."""
    begin = next((one.stamp for one in changes if one.target is State.TAKING_OFF), 0.0)
    return [grasp_decision(d.stamp - begin, d.grasp.value, d.attempt, d.text) for d in decisions]


@dataclass
class Outcome:
    """Result that an engine returns."""

    series: Series | None  # None without a recorded control tick
    wall_s: float = 0.0  # wall time from first to last tick
    abort_reason: str = ""  # reason of the mission's abort
    failure: str = ""  # technical reason of the flight's end, one line
    details: Sequence[str] = ()  # last lines of the node's log
    interrupted: bool = False
    latency_s: Sequence[float] | None = None  # (ticks,) realtime only
    missed_ticks: int | None = None  # realtime only
    notes: list[str] = field(default_factory=list)
    parameter_changes: list[dict[str, Any]] = field(default_factory=list)  # see `log_reader`
    transitions: list[dict[str, Any]] = field(default_factory=list)  # see `transition`
    grasps: list[dict[str, Any]] = field(default_factory=list)  # see `grasp_decision`
    faults: list[dict[str, Any]] = field(default_factory=list)  # see `faults.timeline.record`
    errors_of: str = ""  # "" for errors truth − reference, else what stands for the truth
    done: bool = False  # whether a log has the mission's end

    @property
    def partial(self) -> bool:
        """Return whether the recording ends before the mission."""
        return bool(self.failure) or self.interrupted

    @property
    def reason(self) -> str:
        """Return the engine's reason for an incomplete mission, "" without one."""
        if self.interrupted:
            return "interrupted by the user"
        return self.failure or self.abort_reason


def _not_begun(
    planned: Sequence[Mapping[str, Any]], begun: Sequence[Mapping[str, Any]]
) -> list[str]:
    """Return a note for each fault that did not begin; both as in info.json."""
    left, notes = [(one["fault"], one["parameters"]) for one in begun], []
    for one in planned:
        name, after = one["fault"], one.get("after")
        same = [other for other in left if other[0] == name and other[1].items() <= one.items()]
        if same:
            left.remove(same[0])
        else:
            when = f"{one['at']}+{after:g}" if after else one["at"]
            notes.append(f"the fault {name}@{when} did not begin: the flight ended before")
    return notes


def complete(
    folder: ResultFolder, known: Mapping[str, Any], outcome: Outcome
) -> dict[str, Any] | None:
    """Write metrics, table and facts of a flight; known: its settings, see `settings_facts`."""
    if outcome.partial:
        outcome.notes.insert(0, f"partial: the recording ends with the flight ({outcome.reason})")
    info = {
        **known,
        "wall_s": outcome.wall_s,
        "abort_reason": outcome.reason,
        "partial": outcome.partial,
        "notes": outcome.notes,
        "missed_ticks": outcome.missed_ticks,
        "parameter_changes": outcome.parameter_changes,
        "transitions": outcome.transitions,
        "grasps": outcome.grasps,
        "faults": outcome.faults,
    }
    if outcome.series is not None:
        late = _not_begun(known.get("faults_planned") or (), outcome.faults)
        outcome.notes.extend(note for note in late if note not in outcome.notes)
    if outcome.errors_of:
        info["errors_of"] = outcome.errors_of
        text = f"errors are {outcome.errors_of} − reference: a vehicle has no simulator's truth"
        if text not in outcome.notes:
            outcome.notes.append(text)
    write_json(folder.info, info)
    if outcome.series is None:
        return None
    outcome.series.info.update(info)
    outcome.series.write(folder.timeseries)
    figures = metrics.compute(outcome.series, info, outcome.latency_s)
    write_json(folder.metrics, figures)
    return figures
