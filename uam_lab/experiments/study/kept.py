"""Results of a study's flights, kept in a table, so that an interrupted study continues."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from uam_lab.experiments.campaign.flying import fly_missing
from uam_lab.experiments.campaign.inputs import inputs
from uam_lab.experiments.study.flights import StudyFlight, StudyResult, measure
from uam_lab.experiments.workers.place import Workplace
from uam_lab.records.results.row_table import RowTable

FILE = "flown.parquet"
ERRORS = ("position_m", "attitude_deg", "arm_deg")
NESTED = ("shares", "gains")  # JSON in the table
SCHEMA = pa.schema(
    [
        *(("mark", pa.string()), ("row", pa.string()), ("condition", pa.string())),
        *(("seed", pa.int64()), ("outcome", pa.string())),
        *((name, pa.float64()) for name in ERRORS),
        *((name, pa.string()) for name in NESTED),
    ]
)


def fly(
    flights: Sequence[StudyFlight],
    place: Workplace,
    out: Path,
    progress: Callable[[int, StudyResult], None] = lambda done, result: None,
) -> list[StudyResult]:
    """Fly those that the folder `out` has no result of; return all, in the order of `flights`."""
    table = RowTable(out / FILE, SCHEMA, {"rows": "of studies"})
    marks = [mark(flight) for flight in flights]
    trials = dict(zip(marks, flights, strict=True))
    rows = fly_missing(table, trials, place, _to_row, measure, progress)
    return [_from_row(rows[name]) for name in marks]


def mark(flight: StudyFlight) -> str:
    """Return what identifies the inputs of a flight: profile, scenario, vehicle, seed, code."""
    trial = flight.trial
    given = (
        *(flight.row, flight.condition, flight.judged, trial.payload_mass, trial.seed),
        *(sorted(trial.vehicle_changes.items()), trial.faults, trial.profile.sections),
        *(trial.engine, inputs(trial.profile.vehicle, trial.scenario, {})),
    )
    return hashlib.sha256(repr(given).encode()).hexdigest()[:16]


def _to_row(key: str, result: StudyResult) -> dict[str, Any]:
    return {
        **{"mark": key, "row": result.row, "condition": result.condition},
        **{"seed": result.seed, "outcome": result.outcome},
        **dict(zip(ERRORS, result.errors, strict=True)),
        **{name: json.dumps(getattr(result, name)) for name in NESTED},
    }


def _from_row(row: Mapping[str, Any]) -> StudyResult:
    gains = {name: tuple(values) for name, values in json.loads(row["gains"]).items()}
    errors = tuple(row[name] for name in ERRORS)
    shares = json.loads(row["shares"])
    named = (row["row"], row["condition"], row["seed"])
    return StudyResult(*named, errors, row["outcome"], shares, gains)
