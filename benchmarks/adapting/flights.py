"""The flights of a study: each row in each condition, and what is measured of one."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import yaml

from adapting import law_terms
from adapting.description import Condition, Study
from uam_control.coordinates import ARM, ATTITUDE
from uam_control.profiles.profile import Profile
from uam_lab.experiments.trials.carried import inputs
from uam_lab.experiments.trials.outcome import LOST, classify
from uam_lab.experiments.trials.rows import Rows
from uam_lab.experiments.trials.trial import Trial, figures_of, recorded
from uam_lab.records.results.phase_errors import distance, rms
from uam_lab.records.results.timeseries import SUBSYSTEMS, Series
from uam_sim_bridge.faults.schedule import Schedule, late, parse_spec, timed
from uam_sim_bridge.plant import Vehicle

# states of a flight that the supervisor did not change
PLANNED = {"grounded", "taking off", "flying", "landing", "disarmed"}
FLOWN = "flown"
PX4 = "position"  # setpoint of a flight whose attitude is PX4's own
GAINS = ("K0", "K1", "K2", "K3", "zeta", "rho")
ERRORS = ("position_m", "attitude_deg", "arm_deg")


@dataclass(frozen=True, kw_only=True)
class StudyFlight(Trial):
    """One flight of a row, its label. judged: phases that are measured, () for the whole flight."""

    condition: str
    judged: tuple[str, ...] = ()


@dataclass(frozen=True)
class StudyResult:
    """Result of one flight, in the judged phases.

    errors: RMS of the distance to the reference [m], of the worst attitude angle and the worst
    joint [deg]; NaN where not measured. outcome: FLOWN, or one of `outcome.OUTCOMES` after a
    hold, an abort or a loss; the place of the landing does not count. shares: see
    `law_terms.shares`. gains: subsystem → mean of K0..K3, zeta, rho of the modular law.
    """

    row: str
    condition: str
    seed: int
    errors: tuple[float, float, float]
    outcome: str
    shares: dict[str, dict[str, Any]]
    gains: dict[str, list[float]] = field(default_factory=dict)

    @property
    def flown(self) -> bool:
        """Whether all of the reference was flown."""
        return self.outcome == FLOWN


ROWS = Rows(StudyResult, {"errors": ERRORS}, pa.field("mark", pa.string()))


def mark(flight: StudyFlight) -> str:
    """Return what identifies the inputs of a flight: profile, scenario, vehicle, seed, code."""
    given = (
        *(flight.label, flight.condition, flight.judged, flight.payload_mass, flight.seed),
        *(sorted(flight.vehicle_changes.items()), flight.faults, flight.profile.sections),
        *(flight.engine, inputs(flight.profile.vehicle, flight.scenario, {})),
    )
    return hashlib.sha256(repr(given).encode()).hexdigest()[:16]


def scenario_file(study: Study, condition: Condition, folder: Path) -> Path:
    """Write the condition's scenario to the folder; return its file."""
    folder.mkdir(parents=True, exist_ok=True)
    name = "".join(c if c.isalnum() else "_" for c in condition.label)
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump(study.scenario(condition), sort_keys=False), encoding="utf-8")
    return file


def flights(
    study: Study,
    profiles: dict[str, Profile],
    conditions: Sequence[Condition],
    seeds: Sequence[int],
    folder: Path,
    delay: float = 0.0,
) -> list[StudyFlight]:
    """Return the flights of rows (label → profile). folder: for the scenarios; delay [s]: of the
    setpoints."""
    late_by = [timed(parse_spec(text), {}, "delay") for text in late(delay, 0.0, 0.0, 0.0)]
    return [
        StudyFlight(
            label,
            made,
            0.0,
            seed,
            str(scenario_file(study, condition, folder)),
            vehicle_changes=dict(condition.vehicle),
            faults=Schedule(tuple(late_by), seed),
            condition=condition.label,
            judged=tuple(study.document["judged"]),
        )
        for label, made in profiles.items()
        for condition in conditions
        for seed in seeds
    ]


def measure(trial: StudyFlight) -> StudyResult:
    """Fly; return the result. Raises TrialFailed as `trial.recorded`."""
    outcome = recorded(trial)
    series = outcome.series
    figures = figures_of(trial, outcome, outcome.abort_reason)
    ended = classify(series, figures)
    states = {change["to"] for change in outcome.transitions}
    if not (outcome.abort_reason or outcome.failure or ended == LOST or states - PLANNED):
        ended = FLOWN
    rows = judged_rows(series, trial.judged)
    by_position = trial.profile.section("mavlink_bridge").get("setpoint") == PX4
    vehicle = Vehicle.of(trial.profile.vehicle).changed(trial.vehicle_changes)
    shares = law_terms.shares(series, trial.profile.sets, vehicle, trial.payload_mass, trial.judged)
    if by_position:  # nothing acts on the outputs of the other two laws
        shares = {name: found for name, found in shares.items() if name == "arm"}
    return StudyResult(
        trial.label,
        trial.condition,
        trial.seed,
        errors_of(series, rows, not by_position),
        ended,
        shares,
        _gains(series, rows),
    )


def judged_rows(series: Series, judged: tuple[str, ...]) -> np.ndarray:
    """Return the mask (ticks,) of the judged phases."""
    if not judged:
        return series.flown
    return series.flown & np.any([series.in_phase(name) for name in judged], axis=0)


def errors_of(series: Series, rows: np.ndarray, attitude: bool) -> tuple[float, float, float]:
    """Return the errors of `StudyResult` at the ticks `rows`; attitude: whether it is measured."""
    if not rows.any():
        return (float("nan"),) * 3
    error = series.block("error.")[rows]
    worst = [
        float(np.degrees(max(rms(column) for column in error[:, part].T)))
        for part in (ATTITUDE, ARM)
    ]
    return (
        rms(distance(series, rows)),
        worst[0] if attitude else float("nan"),
        worst[1],
    )


def _gains(series: Series, rows: np.ndarray) -> dict[str, list[float]]:
    found = {}
    for name in SUBSYSTEMS:
        columns = [series[f"adaptation.{name}.{gain}"][rows] for gain in GAINS]
        if rows.any() and np.isfinite(columns[0]).all():
            found[name] = [float(np.mean(column)) for column in columns]
    return found
