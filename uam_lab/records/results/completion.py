"""Complete a result folder after a flight: table, facts and metrics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from uam_lab.records.results import metrics
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder, write_json


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
