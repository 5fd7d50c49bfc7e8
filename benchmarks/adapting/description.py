"""The description of a study: study.yaml, or another file."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from uam_control.laws import catalogue
from uam_control.settings.section import Section, read_section
from uam_control.vehicle import VehicleDescription, load_description

STUDY = Path(__file__).parent / "study.yaml"
NOMINAL = "nominal"
FROZEN = ("", "zero", "margin", "converged")


class StudyError(ValueError):
    """The file of a study is not usable; the text is one line."""


@dataclass(frozen=True)
class Row:
    """One controller. law: "" for `profiles` alone; frozen: one of FROZEN; own_autopilot: the
    autopilot's own gains instead of the study's; common: one rate of adaptation for all subsystems;
    conditions: those that it flies, () for all.
    """

    label: str
    law: str = ""
    frozen: str = ""
    profiles: tuple[str, ...] = ()
    own_autopilot: bool = False
    common: bool = False
    conditions: tuple[str, ...] = ()


@dataclass(frozen=True)
class Condition:
    """What a flight differs in. of: the factor that is varied, value: its size.

    vehicle: dotted changes of the plant's numbers; trajectory: changes of the scenario's.
    """

    label: str
    vehicle: dict[str, Any]
    trajectory: dict[str, Any]
    of: str = ""
    value: float = 0.0


@dataclass(frozen=True)
class Study:
    """A study. document: the content of its file."""

    name: str
    document: dict[str, Any]
    vehicle: VehicleDescription
    rows: tuple[Row, ...]
    conditions: tuple[Condition, ...]

    def condition(self, label: str) -> Condition:
        """Return the condition of this label."""
        return next(one for one in self.conditions if one.label == label)

    def without_integrators(self) -> VehicleDescription:
        """Return the vehicle with the study's gains of the autopilot."""
        gains = self.vehicle.autopilot_gains | self.document["autopilot"]
        return replace(self.vehicle, autopilot_gains=gains)

    def with_adaptation(self, law: str, values: Mapping[str, float]) -> Study:
        """Return the study with other numbers of a law's adaptation."""
        document = deepcopy(self.document)
        document["adaptation"][law] |= values
        return replace(self, document=document)

    def scenario(self, condition: Condition) -> dict[str, Any]:
        """Return the document of the condition's scenario."""
        document = deepcopy(self.document["scenario"])
        if condition.trajectory:
            document["trajectory"] = document.get("trajectory", {}) | condition.trajectory
        return document


def load_study(file: Path = STUDY) -> Study:
    """Read a study. Raises StudyError, ConfigurationError."""
    top = read_section(file, StudyError)
    document = top.values
    given = top.section("rows")
    rows = tuple(_row(given.section(label), label) for label in given.values)
    base, varied = _mapping(top, "nominal"), _mapping(top, "conditions")
    conditions = (
        _condition(NOMINAL, base, Section({}, varied.where, StudyError)),
        *(_condition(label, base, varied.section(label)) for label in varied.values),
    )
    known = {one.label for one in conditions}
    for row in rows:
        if strange := sorted(set(row.conditions) - known):
            raise StudyError(f"{file}: {row.label}: no condition '{strange[0]}'")
    return Study(file.stem, document, load_description(top.text("vehicle")), rows, conditions)


def _mapping(section: Section, key: str) -> Section:
    """Return the entry `key`, a mapping that may be empty or missing."""
    if section.values.get(key, {}) == {}:
        return Section({}, f"{section.where} {key}", StudyError)
    return section.section(key)


def _row(entry: Section, label: str) -> Row:
    entry.only(("law", "frozen", "profiles", "conditions", "autopilot", "common"))
    law = entry.one_of("law", catalogue.LAWS, default="")
    frozen = entry.one_of("frozen", FROZEN[1:], default="")
    profiles = entry.texts("profiles", default=())
    if not law and not profiles:
        raise StudyError(f"{entry.where}: a law or profiles expected")
    return Row(
        label,
        law,
        frozen,
        profiles,
        entry.values.get("autopilot") == "own",
        entry.switch("common", default=False),
        entry.texts("conditions", default=()),
    )


def _condition(label: str, base: Section, entry: Section) -> Condition:
    base.only(("vehicle", "trajectory"))
    entry.only(("vehicle", "trajectory", "of", "value"))
    vehicle, trajectory = (
        _mapping(base, key).values | _mapping(entry, key).values
        for key in ("vehicle", "trajectory")
    )
    factor = entry.text("of", default="")
    value = entry.number("value", default=0.0)
    return Condition(label, vehicle, trajectory, factor, value)
