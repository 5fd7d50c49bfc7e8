"""The flown parameters beside the paper's Table I, active safeguards, and changes in flight."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.laws.law_parameters import SAFEGUARD
from uam_control.profiles.profile import (
    CONTROLLERS,
    NODES,
    ProfileError,
    load_profile,
    parameter_set,
    read_sections,
)
from uam_control.settings.parameter_set import ParameterError, ParameterSet

PAPER_PROFILE = "paper_table1"
LABELS = 40  # largest number of labels in a figure; more would cover the lines


@dataclass(frozen=True)
class ParameterRow:
    """One parameter: `paper` is empty where Table I's profile has no such parameter."""

    name: str
    description: str
    unit: str
    flown: str
    paper: str
    differs: bool
    safeguard_on: bool


def compare(parameter_file: Path) -> dict[str, dict[str, list]]:
    """Compare the effective parameters of a flight with the verbatim Table I.

    Returns `controllers` and `others`: node → its rows; `safeguards`: controller → its active ones
    with values, without controllers that have none.

    Raises ProfileError if the file is missing or is no ROS parameter file.
    """
    flown = read_sections(parameter_file)
    paper = load_profile(PAPER_PROFILE).sets
    rows = {}
    for node, values in flown.items():
        specs = _specs(parameter_file, node, values)
        table = _table(paper[node], specs) if node in paper else {}
        rows[node] = [_row(name, value, table, specs) for name, value in values.items()]
    controllers = {node: rows[node] for node in CONTROLLERS if node in rows}
    on = {
        node: [f"{row.name} = {row.flown}" for row in found if row.safeguard_on]
        for node, found in controllers.items()
    }
    return {
        "controllers": controllers,
        "others": {n: found for n, found in rows.items() if n not in CONTROLLERS and found},
        "safeguards": {node: names for node, names in on.items() if names},
    }


def _specs(file: Path, node: str, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the specifications of the parameters of the flown law."""
    try:
        return parameter_set(node, values)[0].specs() if node in NODES else {}
    except ParameterError as error:
        raise ProfileError(f"{file}: {node}: {error}") from None


def _table(paper: ParameterSet, specs: Mapping[str, Any]) -> dict[str, Any]:
    """Return Table I's values of the parameters with the same specification in the flown law."""
    known = paper.specs()
    return {name: value for name, value in asdict(paper).items() if specs.get(name) == known[name]}


def _row(name: str, value: Any, table: Mapping[str, Any], specs: Mapping[str, Any]) -> ParameterRow:
    spec = specs.get(name)
    description = getattr(spec, "description", "")
    known = name in table
    return ParameterRow(
        name=name,
        description=description,
        unit=getattr(spec, "unit", ""),
        flown=text(value),
        paper=text(table[name]) if known else "",
        differs=known and not _same(value, table[name]),
        safeguard_on=description.startswith(SAFEGUARD) and bool(np.any(value)),
    )


def _same(one: Any, other: Any) -> bool:
    """Return whether two values are equal; YAML gives lists, parameter sets have tuples."""
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return list(one) == list(other)
    return one == other


def text(value: Any) -> str:
    """Return a parameter value as text; a list of equal entries is written once."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, int | float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        parts = [text(item) for item in value]
        return f"{parts[0]} (each)" if len(parts) > 1 and len(set(parts)) == 1 else ", ".join(parts)
    return str(value)


def changes(info: Mapping[str, Any]) -> list[tuple[int, dict[str, Any]]]:
    """Return every request of a flight with its number in the figures, in order.

    info: see `log_reader.parameter_changes`.
    """
    return list(enumerate(info.get("parameter_changes") or [], start=1))


def together(marks: Iterable[tuple[float, Any]], apart: float) -> list[tuple[float, list[Any]]]:
    """Return (time [s], items) of marks in order; those closer than `apart` [s] share a time."""
    groups: list[tuple[float, list[Any]]] = []
    for time, item in marks:
        if groups and time - groups[-1][0] < apart:
            groups[-1][1].append(item)
        else:
            groups.append((time, [item]))
    return groups


def labels(shown: Iterable[tuple[int, dict]], apart: float) -> list[tuple[float, str]]:
    """Return (time, text) of the labels of `changes`; those closer than `apart` [s] share one."""
    groups = together([(one["time_s"], number) for number, one in shown], apart)
    if len(groups) > LABELS:
        return []
    return [(time, _span(numbers[0], numbers[-1])) for time, numbers in groups]


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}–{last}"
