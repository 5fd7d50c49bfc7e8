"""Changes of parameters in flight: numbered in the figures, listed on the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from uam_lab.report.facts.parameter_table import text

LABELS = 40  # largest number of labels in a figure; more would cover the lines


@dataclass(frozen=True)
class ChangeRow:
    """One request: its number in the figures, mission time [s], and its result."""

    number: int
    time: float
    node: str
    by: str
    accepted: bool
    reason: str
    values: tuple[tuple[str, str, str], ...]  # name, old, new


def rows(info: Mapping[str, Any]) -> list[ChangeRow]:
    """Return every request of a flight, in order; info: see `log_reader.parameter_changes`."""
    return [
        ChangeRow(
            number=number,
            time=one["time_s"],
            node=one["node"],
            by=one["by"],
            accepted=one["accepted"],
            reason=one["reason"],
            values=tuple(
                (name, _text(old), _text(new)) for name, (old, new) in one["values"].items()
            ),
        )
        for number, one in enumerate(info.get("parameter_changes") or [], start=1)
    ]


def labels(shown: Sequence[ChangeRow], apart: float) -> list[tuple[float, str]]:
    """Return (time, text) of the labels; requests closer than `apart` [s] share one label."""
    groups: list[list[ChangeRow]] = []
    for row in shown:
        if groups and row.time - groups[-1][0].time < apart:
            groups[-1].append(row)
        else:
            groups.append([row])
    if len(groups) > LABELS:
        return []
    return [(group[0].time, _span(group[0].number, group[-1].number)) for group in groups]


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}–{last}"


def _text(value: Any) -> str:
    return "–" if value is None else text(value)
