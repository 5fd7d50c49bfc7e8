"""Injected faults of a flight: shaded in the figures, listed on the page."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from uam_lab.report.facts.parameter_table import text, together
from uam_lab.report.figures import style

APART = 0.02  # of the time axis; closer letters share one place
SHADE = 0.16  # opacity
LETTER = {"fontsize": 7.0, "fontweight": "bold", "color": style.FAULT}


@dataclass(frozen=True)
class FaultMark:
    """One fault: its letter in the figures, name, mission times [s], parameters."""

    letter: str
    name: str
    begin: float
    end: float | None  # None: active until the end of the flight
    values: tuple[tuple[str, str], ...]


def rows(info: Mapping[str, Any]) -> list[FaultMark]:
    """Return every fault of a flight, in order; info: with `faults` as in metrics.json."""
    return [
        FaultMark(
            letter=letter(number),
            name=one["fault"],
            begin=one["begin_s"],
            end=one["end_s"],
            values=tuple((name, text(value)) for name, value in one["parameters"].items()),
        )
        for number, one in enumerate(info.get("faults") or [])
    ]


def letter(number: int) -> str:
    """Return A, B ... Z, AA, AB ... for 0, 1 ..."""
    first, last = divmod(number, 26)
    return (letter(first - 1) if first else "") + chr(ord("A") + last)


def shade(axes: np.ndarray, info: Mapping[str, Any], start: float, end: float) -> None:
    """Shade the time span of each fault in all panels, with its letter in the top row."""
    shown = [row for row in rows(info) if row.begin <= end and (row.end or end) >= start]
    for row in shown:
        begin, over = max(row.begin, start), min(end if row.end is None else row.end, end)
        for axis in axes.flat:
            axis.axvspan(begin, over, color=style.FAULT, alpha=SHADE, linewidth=0.0, zorder=0.5)
            axis.axvline(begin, color=style.FAULT, linewidth=0.8, zorder=2.3)
    marks = sorted((max(row.begin, start), row.letter) for row in shown)
    for axis in axes[0]:
        for at, letters in together(marks, APART * (end - start)):
            style.note(axis, " ".join(letters), (at, 0.0), (2, 2), **LETTER)


def handles(info: Mapping[str, Any]) -> list[Line2D]:
    """Return the legend entry of the faults, if there are any."""
    if not rows(info):
        return []
    return [style.key("fault", style.FAULT, 6.0, alpha=2.0 * SHADE)]
