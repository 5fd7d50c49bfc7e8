"""The faults of a flight and their times, read and checked from options, files and scenarios.

The text of an option --fault: docs/faults.md. The entry of a file (a list, or a mapping with the
list `faults`) and of a scenario's `faults`:

    - {fault: motor_loss, at: pick, after: 1, duration: 5, motor: 2, remaining: 0.7}
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uam_control.mission import Scenario
from uam_control.settings import yaml_file
from uam_control.settings.json_text import read_mapping
from uam_sim_bridge.faults.fault import Fault, FaultError
from uam_sim_bridge.faults.fault_catalogue import make

FORM = (
    "NAME@SECONDS[+DURATION], NAME@PHASE[+AFTER[+DURATION]] or NAME@start, "
    "then :parameter=value,..."
)
START = "start"  # in place of a time: from the first tick on
FROM_START = -math.inf  # [s] of mission time
KEYS = ("fault", "at", "after", "duration")
LATEST = 1e5  # [s] of mission time
SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True)
class TimedFault:
    """A fault of a flight and its time."""

    fault: Fault
    at: float  # [s] mission time; FROM_START: from the first tick on
    duration: float = math.inf  # [s]; inf: until the end of the flight
    phase: str = ""  # from its begin `at` counts; "": from take-off

    @property
    def entry(self) -> dict[str, Any]:
        """Return the fault as an entry of a file."""
        lasting = {} if math.isinf(self.duration) else {"duration": self.duration}
        return {"fault": self.fault.NAME, **self.moment, **lasting, **self.fault.to_mapping()}

    @property
    def moment(self) -> dict[str, Any]:
        """Return when it begins, as in an entry."""
        if self.phase:
            return {"at": self.phase, "after": self.at}
        return {"at": START if self.at == FROM_START else self.at}

    @property
    def text(self) -> str:
        """Return the fault as an option text, without parameters that have their defaults."""
        usual = type(self.fault)()
        times = [str(value) for value in self.moment.values()]
        times += [] if math.isinf(self.duration) else [str(self.duration)]
        given = [
            f"{name}={value}"
            for name, value in self.fault.to_mapping().items()
            if value != getattr(usual, name)
        ]
        return f"{self.fault.NAME}@{'+'.join(times)}" + (":" + ",".join(given) if given else "")


@dataclass(frozen=True)
class Schedule:
    """All faults of a flight; seed: of their random numbers."""

    faults: tuple[TimedFault, ...] = ()
    seed: int = 1

    def __bool__(self) -> bool:
        return bool(self.faults)

    def only(self, place: str) -> Schedule:
        """Return the faults that act on `place`: PLANT, LINK, PROCESS or CABLE."""
        chosen = tuple(one for one in self.faults if one.fault.PLACE == place)
        return Schedule(chosen, self.seed)

    @property
    def entries(self) -> list[dict[str, Any]]:
        """Return all faults as entries of a file."""
        return [one.entry for one in self.faults]

    def to_text(self) -> str:
        """Return the value of a node's parameter; "" without faults."""
        return json.dumps({"seed": self.seed, "faults": self.entries}) if self else ""

    @classmethod
    def from_text(cls, text: str) -> Schedule:
        """Return the schedule of a text by `to_text`; raises FaultError in one line."""
        if not text:
            return cls()
        where, expected = "faults", 'faults: {"seed": N, "faults": [...]} expected, as JSON'
        document = read_mapping(text, FaultError, expected)
        entries, seed = document.get("faults"), document.get("seed")
        if not isinstance(seed, int):
            raise FaultError(expected)
        return cls(tuple(timed(entry, None, where) for entry in listed(entries, where)), seed)


def late(setpoint: float, setpoint_jitter: float, mocap: float, mocap_jitter: float) -> list[str]:
    """Return the option texts of delays [s] from the start: of setpoints and of mocap poses.

    jitter [s]: largest further delay of a single message.
    """
    given = (
        ("mavlink_delay", setpoint, setpoint_jitter, ",direction=to_autopilot"),
        ("mocap_latency", mocap, mocap_jitter, ""),
    )
    return [
        f"{name}@{START}:delay={delay:.6g},jitter={jitter:.6g}{more}"
        for name, delay, jitter, more in given
        if delay or jitter
    ]


def read_schedule(given: Sequence[str], scenario: Scenario, seed: int) -> Schedule:
    """Return the scenario's faults and those `given`, as option texts or names of YAML files.

    Raises FaultError in one line.
    """
    phases = scenario.phase_names
    found = [
        timed(entry, phases, f"scenario {scenario.name}")
        for entry in listed(list(scenario.faults), f"scenario {scenario.name}")
    ]
    for text in given:
        if Path(text).suffix in SUFFIXES:
            found += [timed(entry, phases, text) for entry in from_file(Path(text))]
        else:
            found.append(timed(parse_spec(text), phases, f"fault '{text}'"))
    return Schedule(tuple(found), seed)


def from_file(file: Path) -> list[Mapping[str, Any]]:
    """Return the entries of a YAML file; raises FaultError."""
    document = yaml_file.read(file, FaultError)
    entries = document.get("faults") if isinstance(document, dict) else document
    return listed(entries, str(file))


def listed(entries: Any, where: str) -> list[Mapping[str, Any]]:
    """Return `entries` if it is a list of mappings; raises FaultError otherwise."""
    good = isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries)
    if not good:
        raise FaultError(f"{where}: a list of faults expected, each as {{fault: NAME, at: ...}}")
    return entries


def parse_spec(text: str) -> dict[str, Any]:
    """Return the entry of an option text; raises FaultError if it has another form."""
    head, colon, tail = text.partition(":")
    name, at, when = head.partition("@")
    first, *numbers = when.split("+")
    if not name or not at or not first or (colon and not tail):
        raise FaultError(f"fault '{text}': {FORM} expected")
    begins = _number(first)
    keys = ("after", "duration") if begins is None else ("duration",)
    if len(numbers) > len(keys):
        raise FaultError(f"fault '{text}': {FORM} expected")
    entry: dict[str, Any] = {"fault": name, "at": first if begins is None else begins}
    for key, value in zip(keys, numbers, strict=False):
        entry[key] = value if (number := _number(value)) is None else number
    for pair in tail.split(",") if tail else ():
        parameter, equals, value = pair.partition("=")
        if not equals or parameter in entry:
            raise FaultError(f"fault '{text}': '{pair}' is not one parameter=value")
        entry[parameter] = value if (number := _number(value)) is None else number
    return entry


def timed(entry: Mapping[str, Any], phases: Collection[str] | None, where: str) -> TimedFault:
    """Return the fault of an entry; raises FaultError with `where` in front.

    phases: allowed names of phases; None: any.
    """
    values = {key: value for key, value in entry.items() if key not in KEYS}
    try:
        fault = make(entry.get("fault"), values)
        at, phase = entry.get("at"), ""
        if at == START:
            if "after" in entry or "duration" in entry:
                raise FaultError(f"at: {START}: such a fault lasts for the whole flight")
            at = FROM_START
        elif isinstance(at, str):
            if phases is not None and at not in phases:
                raise FaultError(
                    f"at: no phase '{at}' in the scenario, which has: " + ", ".join(phases)
                )
            at, phase = _span(entry, "after", 0.0), at
        elif "after" in entry:
            raise FaultError("after: only together with a phase")
        else:
            at = _span(entry, "at", None)
        if (duration := _span(entry, "duration", math.inf)) == 0.0:
            raise FaultError("duration: 0 s is no fault; without a duration it lasts")
    except FaultError as error:
        raise FaultError(f"{where}: {error}") from None
    return TimedFault(fault, at, duration, phase)


def _span(entry: Mapping[str, Any], key: str, default: float | None) -> float:
    value = entry.get(key, default)
    if key not in entry and default is not None:
        return default
    good = isinstance(value, int | float) and not isinstance(value, bool)
    if not good or not 0.0 <= value <= LATEST:
        raise FaultError(f"{key}: {value!r} is not a time within 0 to {LATEST:g} s")
    return float(value)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
