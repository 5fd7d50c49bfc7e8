"""One flight of a fault matrix, and its result."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uam_lab.experiments.faults.matrix import Cell
from uam_lab.experiments.trials.outcome import COMPLETED, LOST, classify, down_after, ending
from uam_lab.experiments.trials.rows import Rows
from uam_lab.experiments.trials.trial import Trial, figures_of, fly
from uam_lab.records.results.outcome import Outcome


@dataclass(frozen=True, kw_only=True)
class FaultTrial(Trial):
    """One flight, of a cell of the matrix."""

    cell: Cell
    lab: str = ""  # name or file of a rehearsal
    broken: Path = Path()  # folder of the rehearsals that broke a promise


@dataclass(frozen=True)
class FaultResult:
    """Result of one flight. worst: largest errors, with the keys of `max` in metrics.json."""

    fault: str
    moment: str
    outcome: str
    why: str  # unmet criteria of a completed mission, notes of the flight
    duration_s: float
    worst: Mapping[str, list[float | None]] = field(default_factory=dict)
    happened: tuple[dict[str, Any], ...] = ()  # the injected faults, see `faults.timeline.record`
    down_after_s: float | None = None  # fault to final touchdown; None: completed, or no touchdown
    kept: bool | None = None  # whether the promise was kept, None without a promise
    given: str = ""  # the faults as option texts
    tilt_deg: float | None = None  # the largest, None without a recording
    impact: float | None = None  # speed at the ground [m/s], None without a recording


def measure(trial: FaultTrial) -> FaultResult:
    """Fly a trial; return its result. Raises ConfigurationError, ScenarioError."""
    outcome = fly(trial)
    recorded = outcome.series is not None
    figures = figures_of(trial, outcome, outcome.reason) if recorded else None
    return judged(trial.cell, outcome, figures)


def judged(cell: Cell, outcome: Outcome, figures: Mapping[str, Any] | None) -> FaultResult:
    """Return the result of a flight; figures: its metrics, None without a recording."""
    series, promise = outcome.series, cell.promise
    given = " ".join(one.text for one in cell.schedule.faults)
    if series is None or figures is None:
        broken = None if promise is None else False
        return FaultResult(
            cell.fault, cell.moment, LOST, outcome.reason, 0.0, kept=broken, given=given
        )
    end, came_to = ending(series), classify(series, figures)
    begun = min((one["begin_s"] for one in outcome.faults), default=math.nan)
    unknown = came_to == COMPLETED or math.isnan(begun)
    down = None if unknown else down_after(series, begun)
    why = "; ".join([*figures["shortfalls"], *outcome.notes])
    return FaultResult(
        fault=cell.fault,
        moment=cell.moment,
        outcome=came_to,
        why=why,
        duration_s=figures["duration_s"],
        down_after_s=down,
        kept=None if promise is None else promise.kept(came_to, down, why),
        worst=figures["max"],
        happened=tuple(outcome.faults),
        given=given,
        tilt_deg=math.degrees(end.largest_tilt),
        impact=end.impact,
    )


ROWS = Rows(FaultResult)
