"""Rebuild a result folder from its log alone: table, metrics, facts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uam_control.mission import Scenario, load_scenario
from uam_control.settings import configuration
from uam_control.settings.atomic import copy, write_text
from uam_control.vehicle import DEFAULT_VEHICLE, VehicleDescription, load_description
from uam_lab.records.recording import log_facts
from uam_lab.records.recording.log_reader import read_flight
from uam_lab.records.results import timeseries
from uam_lab.records.results.outcome import complete
from uam_lab.records.results.result_folder import (
    LOG,
    TABLE,
    ResultFolder,
    ResultFolderError,
    known_json,
    make_folder,
)

CUT_OFF = "the log ends before the mission was over"
FILES = ("parameters.yaml", "versions.json")
PARTIAL = "partial: "


def rebuild(directory: Path, out: Path, scenario: str | None = None) -> dict[str, Any]:
    """Write table, metrics and facts of the flight logged in `directory` to the folder `out`.

    scenario: name or file, for a log without one. Returns the metrics. Facts that are not in the
    log (wall time, reason of the end) are read from `directory` if they are there. Raises
    ResultFolderError, also if another folder `out` contains a flight; UnreadableLog, OSError.
    """
    log, folder = directory / LOG, ResultFolder(out)
    if not log.exists():
        raise ResultFolderError(f"{directory} has no {LOG}")
    if out.resolve() != directory.resolve():
        folder.refuse_flight()
    facts = log_facts.read(log)
    before = known_json(directory / "info.json")
    known = facts.info or before
    flown = _scenario(directory, facts, known, scenario)
    vehicle = _vehicle(known)
    outcome = read_flight(log, flown, vehicle=vehicle)
    numbers = known_json(directory / "logs" / "mujoco_sim.json")
    realtime = known.get("clock") == "realtime"
    outcome.wall_s = numbers.get("wall_s") or before.get("wall_s") or outcome.wall_s
    outcome.latency_s = numbers.get("latency_s", outcome.latency_s) if realtime else None
    missed = numbers.get("missed_ticks", outcome.missed_ticks)
    outcome.missed_ticks = missed if realtime else None
    earlier = [note for note in before.get("notes") or [] if not note.startswith(PARTIAL)]
    outcome.notes = list(dict.fromkeys([*earlier, *outcome.notes]))
    if not outcome.done:
        outcome.failure = before.get("abort_reason") or CUT_OFF
    make_folder(out, shared=True)
    for name in FILES:
        _take_over(name, directory, out, facts.texts)
    return complete(folder, known, outcome)


def copy_flight(directory: Path, out: Path) -> None:
    """Copy what a flight without a log has left in `directory` to the folder `out`.

    Raises ResultFolderError if `out` contains a flight; OSError.
    """
    ResultFolder(out).refuse_flight()
    for name in (TABLE, "metrics.json", "info.json", *FILES):
        if (directory / name).exists():
            copy(directory / name, out / name)


def series_of(directory: Path) -> timeseries.Series:
    """Return the flight in a result folder from its table, else from its log; write nothing.

    Raises ResultFolderError, UnreadableLog, UnreadableFlight, OSError.
    """
    if (directory / TABLE).exists():
        return timeseries.read(directory / TABLE)
    log = directory / LOG
    if not log.exists():
        raise ResultFolderError(f"{directory} has neither {TABLE} nor {LOG}")
    facts = log_facts.read(log)
    known = facts.info or known_json(directory / "info.json")
    scenario = _scenario(directory, facts, known, None)
    flight = read_flight(log, scenario, known, _vehicle(known))
    flight.series.info["parameter_changes"] = flight.parameter_changes
    flight.series.info["faults"] = flight.faults
    return flight.series


def _scenario(
    directory: Path, facts: log_facts.LogFacts, known: Mapping[str, Any], asked: str | None
) -> Scenario:
    """Return the flown scenario: from the user, else from the log, else from info.json."""
    name = asked or (None if facts.scenario else known.get("scenario"))
    if name is not None:
        vehicle = _vehicle(known)
        options = log_facts.options_of(known)
        return load_scenario(str(configuration.named("scenarios", name)), vehicle, options)
    if facts.scenario is None:
        raise ResultFolderError(f"{directory / LOG} contains no scenario: give --scenario")
    return facts.scenario


def _vehicle(known: Mapping[str, Any]) -> VehicleDescription:
    """Return the described vehicle of a flight. Raises VehicleError, ConfigurationError."""
    return load_description(known.get("vehicle") or DEFAULT_VEHICLE)


def _take_over(name: str, directory: Path, out: Path, texts: Mapping[str, str]) -> None:
    """Write file `name` to `out` if it is missing there, from the log's texts or `directory`."""
    if (out / name).exists():
        return
    if name in texts:
        write_text(out / name, texts[name])
    elif (directory / name).exists():
        write_text(out / name, (directory / name).read_text(encoding="utf-8"))
