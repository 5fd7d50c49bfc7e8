"""The cells of a matrix fault × moment, read from config/campaign/faults.yaml or another file."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from uam_control.mission import Scenario, load_scenario
from uam_control.settings import yaml_file
from uam_control.vehicle import VehicleDescription
from uam_lab.campaign.fault_outcome import Promise, read_promise
from uam_sim_bridge.faults import FAULTS, Fault, FaultError, Schedule
from uam_sim_bridge.faults.feasibility import needs_nodes
from uam_sim_bridge.faults.schedule import listed, timed

NOMINAL = "no fault"
KEYS = ("scenario", "moments", "faults")


@dataclass(frozen=True)
class Cell:
    """One flight. fault: the row; moment: the column, "" for the flight without any fault."""

    fault: str
    moment: str
    schedule: Schedule
    promise: Promise | None = None


@dataclass(frozen=True)
class Matrix:
    """Flights of a campaign. moments: entries with the times by name; promises: one per row;
    left_out: rows that the engine cannot fly; own_moments: of each row, () for all."""

    scenario: str
    moments: dict[str, dict[str, Any]]
    faults: tuple[dict[str, Any], ...]
    promises: tuple[Promise | None, ...]
    left_out: tuple[str, ...] = ()
    own_moments: tuple[tuple[str, ...], ...] = ()

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the rows."""
        return tuple(dict.fromkeys(label(entry) for entry in self.faults))

    def cells(self, seed: int, repeat: int = 1) -> list[Cell]:
        """Return all flights, the one without a fault first; seed: of random faults.

        repeat: number of flights per fault and moment.
        """
        found = [Cell(NOMINAL, "", Schedule(seed=seed))]
        own = self.own_moments or ((),) * len(self.faults)
        for entry, promised, chosen in zip(self.faults, self.promises, own, strict=True):
            for moment, when in self.moments.items():
                if chosen and moment not in chosen:
                    continue
                one = timed({**entry, **when}, None, moment)
                found += [Cell(label(entry), moment, Schedule((one,), seed), promised)] * repeat
        return found


def label(entry: dict[str, Any]) -> str:
    """Return a row's name: the fault, its duration, and the given parameters."""
    shown = {key: value for key, value in entry.items() if key not in ("fault", "duration")}
    lasting = f" {entry['duration']:g} s" if "duration" in entry else ""
    values = ", ".join(
        f"{k} {v:g}" if isinstance(v, int | float) else f"{k} {v}" for k, v in shown.items()
    )
    return entry["fault"] + lasting + (f" ({values})" if values else "")


def read(
    file: Path,
    engine: str,
    only: Collection[str] = (),
    moments: Sequence[str] = (),
    scenario: str | None = None,
    vehicle: VehicleDescription | None = None,
) -> Matrix:
    """Read a matrix for an engine. Raises FaultError, ConfigurationError, ScenarioError.

    only: names of faults, () for all; moments: names of columns, () for all; scenario: instead of
    the file's; vehicle: None for the default one.
    """
    document = _document(file)
    name = scenario or str(document["scenario"])
    times = _moments(document["moments"], load_scenario(name, vehicle), str(file))
    entries = listed(document["faults"], str(file))
    rows = [_checked(dict(entry), str(file), times) for entry in entries]
    for given, known in ((only, FAULTS), (moments, times)):
        for one in given:
            if one not in known:
                raise FaultError(
                    f"unknown {'fault' if given is only else 'moment'} '{one}'; "
                    f"there are: {', '.join(known)}"
                )
    selected = [row for row in rows if not only or row.entry["fault"] in only]
    out = [label(row.entry) for row in selected if engine == "direct" and needs_nodes(row.fault)]
    kept = [row for row in selected if label(row.entry) not in out]
    if not kept:
        raise FaultError(f"{file}: nothing to fly with the {engine} engine")
    chosen = {k: v for k, v in times.items() if not moments or k in moments}
    entries, promises = tuple(row.entry for row in kept), tuple(row.promise for row in kept)
    own = tuple(row.moments for row in kept)
    return Matrix(name, chosen, entries, promises, tuple(out), own)


def _document(file: Path) -> dict[str, Any]:
    document = yaml_file.read(file, FaultError)
    if not isinstance(document, dict) or sorted(document) != sorted(KEYS):
        raise FaultError(f"{file}: a mapping of {', '.join(KEYS)} expected")
    return document


def _moments(given: Any, scenario: Scenario, where: str) -> dict[str, dict[str, Any]]:
    """Return the checked times of the moments; they are written like times of faults."""
    if not isinstance(given, dict) or not all(isinstance(v, dict) for v in given.values()):
        raise FaultError(f"{where}: moments: names with {{at: ..., after: ...}} each expected")
    any_fault = next(iter(FAULTS))
    for name, when in given.items():
        timed({**when, "fault": any_fault}, scenario.phase_names, f"{where}: moments: {name}")
    return {str(name): when for name, when in given.items()}


class _Row(NamedTuple):
    entry: dict[str, Any]
    fault: Fault
    promise: Promise | None
    moments: tuple[str, ...]


def _checked(entry: dict[str, Any], where: str, moments: Collection[str]) -> _Row:
    for key in ("at", "after"):
        if key in entry:
            raise FaultError(f"{where}: {key}: not allowed here, the moments give the time")
    promised, own = entry.pop("promise", None), entry.pop("moments", [])
    known = tuple(moments)  # what is asked may not be hashable
    if not isinstance(own, list) or not all(one in known for one in own):
        raise FaultError(f"{where}: moments: a list of {', '.join(moments)} expected, got {own!r}")
    fault = timed({**entry, "at": 0.0}, {}, where).fault
    promise = None if promised is None else read_promise(promised, where)
    return _Row(entry, fault, promise, tuple(own))
