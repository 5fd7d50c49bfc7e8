"""Results of a study's flights, kept in a file, so that an interrupted study continues."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from uam_lab.campaign.pool import fly_all
from uam_lab.study.flights import StudyFlight, StudyResult, measure

FILE = "flown.jsonl"


def fly(
    flights: Sequence[StudyFlight],
    jobs: int,
    out: Path,
    progress: Callable[[int, StudyResult], None] = lambda done, result: None,
) -> list[StudyResult]:
    """Fly those that the folder `out` has no result of; return all, in the order of `flights`."""
    known = _read(out / FILE)
    marks = [mark(flight) for flight in flights]
    lacking = [(f, name) for f, name in zip(flights, marks, strict=True) if name not in known]
    missing = [f for f, _ in lacking]
    names = {(f.row, f.condition, f.trial.seed): name for f, name in lacking}

    def keep(done: int, result: StudyResult) -> None:
        name = names[result.row, result.condition, result.seed]
        known[name] = result
        with (out / FILE).open("a") as file:
            file.write(json.dumps({"flight": name, **asdict(result)}) + "\n")
        progress(len(flights) - len(missing) + done, result)

    if missing:
        fly_all(missing, jobs, work=measure, progress=keep)
    return [known[name] for name in marks]


def mark(flight: StudyFlight) -> str:
    """Return what identifies the inputs of a flight: profile, scenario, plant, seed, delays."""
    trial = flight.trial
    inputs = (
        *(flight.row, flight.condition, flight.judged, trial.payload_mass, trial.seed),
        *(sorted(trial.vehicle_changes.items()), trial.faults, trial.profile.sections),
        sorted(trial.profile.vehicle.autopilot_gains.items()),
        Path(trial.scenario).read_text() if Path(trial.scenario).is_file() else trial.scenario,
    )
    return hashlib.sha256(repr(inputs).encode()).hexdigest()[:16]


def _read(file: Path) -> dict[str, StudyResult]:
    found = {}
    for line in file.read_text().splitlines() if file.exists() else ():
        try:
            values = json.loads(line)
        except ValueError:  # an incomplete last line after a kill
            continue
        name = values.pop("flight")
        values["errors"] = tuple(values["errors"])
        values["gains"] = {key: tuple(gains) for key, gains in values["gains"].items()}
        found[name] = StudyResult(**values)
    return found
