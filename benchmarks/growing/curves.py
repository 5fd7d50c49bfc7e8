"""Curves and table of the cost as work grows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from growing.flights import DIRECT, Point
from uam_lab.report.figures import style

matplotlib.use("Agg")

ABOVE = 1.1  # of the largest value: end of the axis
HEAD = ("what grows", "size", "layout", "ticks/s", "of its first", "memory [MB]", "log [MB/min]")
ROWS: tuple[tuple[str, Callable[[Point], float]], ...] = (
    ("ticks per second", lambda point: point.ticks_per_second),
    ("memory of the nodes\nthat fly [MB]", lambda point: point.memory),
    ("log [MB] per minute", lambda point: point.log),
)


def table(points: Sequence[Point]) -> str:
    """Return one line per point; `of its first`: ticks/s relative to the curve's first point."""
    lines = [_row(HEAD), "|---" * len(HEAD) + "|"]
    for one in points:
        first = _curve(points, one.what, one.layout)[0]
        cells = (one.what, one.size, one.layout, f"{one.ticks_per_second:.0f}")
        cells += (f"{one.ticks_per_second / first.ticks_per_second:.2f}",)
        lines.append(_row((*cells, _text(one.memory, 0), _text(one.log, 1))))
    return "\n".join(lines)


def draw(points: Sequence[Point], *files: Path) -> None:
    """Draw a column per quantity that grows, with a line per layout; the direct engine's ticks per
    second have an axis of their own, on the right."""
    grown = list(dict.fromkeys(one.what for one in points))
    layouts = list(dict.fromkeys(one.layout for one in points if one.layout != DIRECT))
    with style.styled():
        figure = Figure(figsize=(style.WIDTH, 6.2), layout="constrained")
        axes = figure.subplots(len(ROWS), len(grown), squeeze=False, sharex="col", sharey="row")
        for column, what in enumerate(grown):
            for row, (label, value) in enumerate(ROWS):
                axis = axes[row, column]
                for number, layout in enumerate(layouts):
                    curve = _curve(points, what, layout)
                    sizes, values = [p.size for p in curve], [value(p) for p in curve]
                    colour = style.flight_colour(number)
                    axis.plot(sizes, values, "o-", color=colour, label=layout)
                    axis.set_xticks(sizes)
                if column == 0:
                    axis.set_ylabel(label)
            axes[-1, column].set_xlabel(what)
            if curve := _curve(points, what, DIRECT):
                right = axes[0, column].twinx()
                sizes, values = [p.size for p in curve], [p.ticks_per_second for p in curve]
                right.plot(sizes, values, "s--", color=style.MUTED, label=DIRECT)
                right.set_ylim(0.0, ABOVE * right.dataLim.y1)
                right.grid(visible=False)
                right.legend(loc="lower left")
        for row in axes:  # shared, so after the last column's points
            row[0].set_ylim(0.0, ABOVE * max(axis.dataLim.y1 for axis in row))
        axes[0, -1].legend(loc="lower left")
        for file in files:
            style.save(figure, file)


def _curve(points: Sequence[Point], what: str, layout: str) -> list[Point]:
    return [one for one in points if one.what == what and one.layout == layout]


def _text(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def _row(cells: Sequence[object]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"
