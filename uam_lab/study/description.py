"""The description of a study: a file of config/studies."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from uam_control.laws import catalogue
from uam_control.settings import configuration, yaml_file
from uam_control.vehicle import VehicleDescription, load_description
from uam_lab.results.timeseries import SUBSYSTEMS

NOMINAL = "nominal"
FROZEN = ("", "zero", "margin", "converged")
KEYS = (
    *("vehicle", "autopilot", "shared", "law_parameters", "modular_parameters", "feedback"),
    *("spend", "margin_loads", "strengths", "scenario", "judged", "nominal", "seeds", "rows"),
    *("conditions", "factors", "nominal_values", "adaptation", "ranges", "tuning"),
    *("law_sweep", "arm_sweep"),
)


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


def load_study(name_or_file: str) -> Study:
    """Read a study of config/studies, or a file. Raises StudyError, ConfigurationError."""
    file = configuration.named("studies", name_or_file, suffixes=(".yaml",))
    document = yaml_file.read(file, StudyError)
    if not isinstance(document, dict) or set(document) != set(KEYS):
        odd = sorted(set(KEYS) ^ set(document or {}))
        raise StudyError(f"{file}: {odd[0]}: missing, or no entry of a study")
    _check(file, document)
    rows = tuple(_row(file, label, entry) for label, entry in document["rows"].items())
    base = document["nominal"]
    known = {NOMINAL, *document["conditions"]}
    for row in rows:
        if strange := sorted(set(row.conditions) - known):
            raise StudyError(f"{file}: {row.label}: no condition '{strange[0]}'")
    conditions = (
        _condition(NOMINAL, base, {}),
        *(_condition(label, base, entry) for label, entry in document["conditions"].items()),
    )
    return Study(file.stem, document, load_description(document["vehicle"]), rows, conditions)


def _row(file: Path, label: str, entry: dict[str, Any]) -> Row:
    law, frozen = entry.get("law", ""), entry.get("frozen", "")
    if law and law not in catalogue.LAWS:
        raise StudyError(f"{file}: {label}: law '{law}': {', '.join(catalogue.LAWS)} are allowed")
    if frozen not in FROZEN:
        raise StudyError(f"{file}: {label}: frozen '{frozen}': {', '.join(FROZEN[1:])} are allowed")
    if not law and not entry.get("profiles"):
        raise StudyError(f"{file}: {label}: a law or profiles expected")
    profiles = tuple(entry.get("profiles", ()))
    return Row(
        label,
        law,
        frozen,
        profiles,
        entry.get("autopilot") == "own",
        bool(entry.get("common", False)),
        tuple(entry.get("conditions", ())),
    )


def _condition(label: str, base: dict[str, Any], entry: dict[str, Any]) -> Condition:
    return Condition(
        label,
        dict(base.get("vehicle", {})) | entry.get("vehicle", {}),
        dict(base.get("trajectory", {})) | entry.get("trajectory", {}),
        entry.get("of", ""),
        float(entry.get("value", 0.0)),
    )


def _check(file: Path, document: dict[str, Any]) -> None:
    if set(document["feedback"]) != set(SUBSYSTEMS):
        raise StudyError(f"{file}: feedback: {', '.join(SUBSYSTEMS)} expected")
    if not 0.0 < document["spend"] < 1.0:
        raise StudyError(f"{file}: spend: {document['spend']} is outside 0 to 1")
    for law, ranges in document["ranges"].items():
        known = document["adaptation"].get(law, {})
        if set(ranges) != set(known):
            raise StudyError(f"{file}: ranges: {law}: the entries of adaptation expected")
        for name, (low, high) in ranges.items():
            if not 0.0 < low <= known[name] <= high:
                raise StudyError(
                    f"{file}: adaptation: {law}: {name}: {known[name]} is outside {low} to {high}"
                )
