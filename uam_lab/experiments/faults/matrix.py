"""The cells of a matrix fault × moment, read from config/campaign/faults.yaml or another file.

With `draws` the flights are random ones of the matrix: one or two of its faults, each at one of its
moments, with one of its durations. A value [low, high] in the file is drawn between both.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from uam_control.mission import load_scenario
from uam_control.settings.section import Section, read_section
from uam_control.vehicle import VehicleDescription
from uam_lab.experiments.trials.outcome import OUTCOMES
from uam_sim_bridge.faults import FAULTS, Fault, FaultError, Schedule, feasibility
from uam_sim_bridge.faults.schedule import TimedFault, listed, timed

NOMINAL = "no fault"
KEYS = ("scenario", "moments", "faults")
DURATIONS = "durations"  # optional: of each row without its own; null: for good
PAIRS = 0.5  # share of the drawn flights with two faults
AND = " and another"  # after the name of the first fault of two


@dataclass(frozen=True)
class Promise:
    """What a flight with a fault promises."""

    outcomes: tuple[str, ...]  # the allowed ones of OUTCOMES
    within: float = math.inf  # [s] longest time from fault to final touchdown, if not completed
    because: str = ""  # part of the reason

    def kept(self, outcome: str, down_after: float | None, why: str) -> bool:
        """Return whether a flight kept the promise.

        down_after [s]: None without touchdown; why: the reason of the end.
        """
        soon = down_after is None or down_after <= self.within
        return outcome in self.outcomes and soon and self.because in why


def read_promise(given: Any, where: str) -> Promise:
    """Read an entry `promise` of a matrix: {outcome: one or a list, within: 8, because: text}.

    Raises FaultError.
    """
    if not isinstance(given, dict) or "outcome" not in given:
        raise FaultError(
            f"{where}: promise: {{outcome: ..., within: seconds, because: text}} expected"
        )
    entry = Section(given, f"{where}: promise:", FaultError)
    entry.only(("outcome", "within", "because"))
    named = given["outcome"]
    outcomes = tuple(named) if isinstance(named, list) else (named,)
    for one in outcomes:
        if not isinstance(one, str) or one not in OUTCOMES:
            raise entry.error("outcome", f"unknown '{one}'; there are: {', '.join(OUTCOMES)}")
    within = entry.positive("within", default=math.inf)
    return Promise(outcomes, within, entry.text("because", default=""))


@dataclass(frozen=True)
class Cell:
    """One flight. fault: the row; moment: the column, "" for the flight without any fault."""

    fault: str
    moment: str
    schedule: Schedule
    promise: Promise | None = None


@dataclass(frozen=True)
class Matrix:
    """Flights of a campaign."""

    scenario: str
    moments: dict[str, dict[str, Any]]  # entries with the times by name
    faults: tuple[dict[str, Any], ...]
    promises: tuple[Promise | None, ...]  # one per row
    left_out: Mapping[str, str] = field(default_factory=dict)  # row or moment → reason
    own_moments: tuple[tuple[str, ...], ...] = ()  # of each row, () for all
    draws: int = 0  # number of random flights in place of one per cell
    durations: tuple[Any, ...] = ()  # of these, for rows without their own

    @property
    def rows(self) -> tuple[str, ...]:
        if self.draws:
            names = dict.fromkeys(entry["fault"] for entry in self.faults)
            return tuple(name + more for name in names for more in ("", AND))
        return tuple(dict.fromkeys(label(entry) for entry in self.faults))

    def cells(self, seed: int, repeat: int = 1) -> list[Cell]:
        """Return all flights, the one without a fault first; seed: of random faults.

        repeat: number of flights per fault and moment.
        """
        found = [Cell(NOMINAL, "", Schedule(seed=seed))]
        if self.draws:
            return found + [self._drawn(seed, number) for number in range(self.draws)]
        own = self.own_moments or ((),) * len(self.faults)
        for entry, promised, chosen in zip(self.faults, self.promises, own, strict=True):
            for moment, when in self.moments.items():
                if chosen and moment not in chosen:
                    continue
                one = timed({**entry, **when}, None, moment)
                found += [Cell(label(entry), moment, Schedule((one,), seed), promised)] * repeat
        return found

    def _drawn(self, seed: int, number: int) -> Cell:
        """Return the random flight of this number: it does not depend on how many are drawn."""
        random = np.random.default_rng([seed, number])
        several = 2 if len(self.faults) > 1 and random.random() < PAIRS else 1
        faults, moments = [], []
        for row in random.choice(len(self.faults), several, replace=False).tolist():
            own = self.own_moments[row] or tuple(self.moments)
            moments.append(own[random.integers(len(own))])
            entry = {**self.faults[row], **self.moments[moments[-1]]}
            if self.durations and "duration" not in entry:
                lasting = self.durations[random.integers(len(self.durations))]
                entry |= {} if lasting is None else {"duration": lasting}
            entry = {key: _between(value, random) for key, value in entry.items()}
            faults.append(timed(entry, None, moments[-1]))
        name = faults[0].fault.NAME + (AND if several > 1 else "")
        return Cell(name, moments[0], Schedule(tuple(faults), seed))


def _between(value: Any, random: np.random.Generator) -> Any:
    """Return a number between both of [low, high], any other value as it is."""
    return round(float(random.uniform(*value)), 3) if isinstance(value, list) else value


def label(entry: dict[str, Any]) -> str:
    """Return a row's name: the fault, its duration, and the given parameters."""
    shown = {key: value for key, value in entry.items() if key not in ("fault", "duration")}
    lasting = f" {_text(entry['duration'])} s" if "duration" in entry else ""
    values = ", ".join(f"{key} {_text(value)}" for key, value in shown.items())
    return entry["fault"] + lasting + (f" ({values})" if values else "")


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def read(
    file: Path,
    engine: str,
    only: Collection[str] = (),
    moments: Sequence[str] = (),
    scenario: str | None = None,
    vehicle: VehicleDescription | None = None,
    draws: int = 0,
) -> Matrix:
    """Read a matrix for an engine. Raises FaultError, ConfigurationError, ScenarioError.

    only: names of faults, () for all; moments: names of columns, () for all; scenario: instead of
    the file's, moments of phases that it does not have are left out; vehicle: None for the default
    one; draws: see `Matrix`.
    """
    top = read_section(file, FaultError)
    top.only((*KEYS, DURATIONS))
    document = top.values | {key: top.entry(key) for key in KEYS}
    name = scenario or str(document["scenario"])
    lasting, where = document.get(DURATIONS, []), str(file)
    if not isinstance(lasting, list):
        raise FaultError(f"{where}: {DURATIONS}: a list of times [s] expected, null for good")
    times = _moments(document["moments"], where)
    phases = load_scenario(name, vehicle).phase_names
    out = _without_phase(times, phases, name) if scenario else {}
    times = {moment: when for moment, when in times.items() if moment not in out}
    if not times:
        raise FaultError(f"{where}: moments: {next(iter(out.values()))}")
    _check_times(times, phases, where, draws)
    entries = listed(document["faults"], where)
    longer = [
        dict(entry) if one is None else {**entry, "duration": one}
        for entry in entries
        for one in (lasting if lasting and "duration" not in entry else [entry.get("duration")])
    ]
    every = {*times, *out}
    checked = [_checked(entry, where, every, draws) for entry in longer]
    rows = [_checked(dict(entry), where, every, draws) for entry in entries] if draws else checked
    for given, known in ((only, FAULTS), (moments, times)):
        for one in given:
            if one not in known:
                raise FaultError(
                    f"unknown {'fault' if given is only else 'moment'} '{one}'; "
                    f"there are: {', '.join(known)}"
                )
    selected = [row for row in rows if not only or row.entry["fault"] in only]
    kept = []
    for row in selected:
        if why := _impossible(row, engine, vehicle, times):
            out[label(row.entry)] = why
        else:
            kept.append(row)
    if not kept:
        reasons = dict.fromkeys(out.values())
        raise FaultError(f"{file}: nothing to fly: {'; '.join(reasons)}")
    chosen = {k: v for k, v in times.items() if not moments or k in moments}
    entries, promises = tuple(row.entry for row in kept), tuple(row.promise for row in kept)
    own = tuple(tuple(one for one in row.moments if one in times) for row in kept)
    drawn = (draws, tuple(lasting)) if draws else ()
    return Matrix(name, chosen, entries, promises, out, own, *drawn)


class _Row(NamedTuple):
    entry: dict[str, Any]
    fault: Fault
    promise: Promise | None
    moments: tuple[str, ...]


def _without_phase(
    times: Mapping[str, Mapping[str, Any]], phases: Collection[str], scenario: str
) -> dict[str, str]:
    """Return the moments at a phase that the scenario does not have, each with the reason."""
    return {
        moment: f"no phase '{at}' in {scenario}, which has: {', '.join(phases)}"
        for moment, when in times.items()
        if isinstance(at := when.get("at"), str) and at not in phases
    }


def _impossible(
    row: _Row, engine: str, vehicle: VehicleDescription | None, times: Collection[str]
) -> str:
    """Return why these flights cannot have the fault of a row, "" if they can."""
    try:
        feasibility.check(Schedule((TimedFault(row.fault, 0.0),)), engine, vehicle=vehicle)
    except FaultError as error:
        return str(error).removeprefix(f"{row.fault.NAME}: ")
    if row.moments and not set(row.moments) & set(times):
        return f"none of its moments: {', '.join(row.moments)}"
    return ""


def _ends(entry: dict[str, Any], draws: int, where: str) -> Iterator[dict[str, Any]]:
    """Yield the entry with the low and with the high end of each value [low, high]."""
    ranges = {key: value for key, value in entry.items() if isinstance(value, list)}
    for key, value in ranges.items():
        numbers = all(isinstance(one, int | float) for one in value)
        if not draws or len(value) != 2 or not numbers or not value[0] <= value[1]:
            only = "two numbers [low, high] expected" if draws else "a range needs --draws"
            raise FaultError(f"{where}: {key}: {value!r}: {only}")
    for end in range(2 if ranges else 1):
        yield entry | {key: value[end] for key, value in ranges.items()}


def _moments(given: Any, where: str) -> dict[str, dict[str, Any]]:
    """Return the times of the moments; they are written like times of faults."""
    mappings = isinstance(given, dict) and [isinstance(when, dict) for when in given.values()]
    if not mappings or not all(mappings):
        raise FaultError(f"{where}: moments: names with {{at: ..., after: ...}} each expected")
    return {str(name): when for name, when in given.items()}


def _check_times(
    times: Mapping[str, dict[str, Any]], phases: Collection[str], where: str, draws: int
) -> None:
    any_fault = next(iter(FAULTS))
    for name, when in times.items():
        at = f"{where}: moments: {name}"
        for one in _ends(when, draws, at):
            timed({**one, "fault": any_fault}, phases, at)


def _checked(entry: dict[str, Any], where: str, moments: Collection[str], draws: int = 0) -> _Row:
    for key in ("at", "after"):
        if key in entry:
            raise FaultError(f"{where}: {key}: not allowed here, the moments give the time")
    promised, own = entry.pop("promise", None), entry.pop("moments", [])
    own = list(map(str, own)) if isinstance(own, list) else own
    if not isinstance(own, list) or not set(own) <= set(moments):
        raise FaultError(f"{where}: moments: a list of {', '.join(moments)} expected, got {own!r}")
    fault = [timed({**one, "at": 0.0}, {}, where).fault for one in _ends(entry, draws, where)][0]
    promise = None if promised is None else read_promise(promised, where)
    return _Row(entry, fault, promise, tuple(own))
