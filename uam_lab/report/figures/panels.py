"""Stacked panels over mission time: phases shaded, payload events marked, long lines thinned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from uam_lab.records.results.timeseries import ON_GROUND, Series
from uam_lab.report.facts import parameter_table
from uam_lab.report.facts.parameter_table import together
from uam_lab.report.figures import style

if TYPE_CHECKING:
    from uam_lab.analysis.stability import Stability
    from uam_lab.report.facts.px4_log import Px4Log

APART = 0.02  # of the time axis; closer letters share one place
SHADE = 0.16  # opacity
LETTER = {"fontsize": 7.0, "fontweight": "bold", "color": style.FAULT}


def fault_marks(info: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Return every fault of a flight with its letter in the figures, in order.

    info: with `faults` as in metrics.json.
    """
    return [(letter(number), one) for number, one in enumerate(info.get("faults") or [])]


def letter(number: int) -> str:
    """Return A, B ... Z, AA, AB ... for 0, 1 ..."""
    first, last = divmod(number, 26)
    return (letter(first - 1) if first else "") + chr(ord("A") + last)


def shade(axes: np.ndarray, info: Mapping[str, Any], start: float, end: float) -> None:
    """Shade the time span of each fault in all panels, with its letter in the top row."""
    shown = [
        (max(one["begin_s"], start), end if one["end_s"] is None else min(one["end_s"], end), name)
        for name, one in fault_marks(info)
        if one["begin_s"] <= end and (one["end_s"] or end) >= start
    ]
    for begin, over, _ in shown:
        for axis in axes.flat:
            axis.axvspan(begin, over, color=style.FAULT, alpha=SHADE, linewidth=0.0, zorder=0.5)
            axis.axvline(begin, color=style.FAULT, linewidth=0.8, zorder=2.3)
    marks = sorted((begin, name) for begin, _, name in shown)
    for axis in axes[0]:
        for at, letters in together(marks, APART * (end - start)):
            style.note(axis, " ".join(letters), (at, 0.0), (2, 2), **LETTER)


def fault_handles(info: Mapping[str, Any]) -> list[Line2D]:
    """Return the legend entry of the faults, if there are any."""
    if not info.get("faults"):
        return []
    return [style.key("fault", style.FAULT, 6.0, alpha=2.0 * SHADE)]


BUCKETS = 900  # about one per pixel column of a panel
RIGHT = 0.985  # right edge of the panels as part of the width
# change of parameters accepted or refused → colour, line style, name in the legend
CHANGES = (
    (True, style.CHANGE, "-", "parameters changed"),
    (False, style.REFUSED, ":", "change refused"),
)
PHASE = {"ha": "center", "va": "bottom", "fontsize": 7.5, "color": style.MUTED}
CHANGE = {"va": "top", "fontsize": 6.5, "color": style.CHANGE}
MAGNET_DASHES = (0, (4, 2.5))
MARGIN_S = 1.0  # shown before take-off and after touchdown


@dataclass(frozen=True)
class DrawnFlight:
    """A flight to draw: name in the legend, series; stability analysis and PX4's log, if any."""

    label: str
    series: Series
    stability: Stability | None = None
    px4: Px4Log | None = None


@dataclass(frozen=True)
class Panel:
    """One axis over time: label with unit, column of the table, factor to the unit of the label."""

    label: str
    column: str
    factor: float = 1.0
    on_ground: bool = False  # ticks on the ground are drawn, too


def window(flights: Sequence[DrawnFlight]) -> tuple[float, float]:
    """Return the mission times [s] of first take-off and last touchdown, with a margin."""
    times = [f.series.time[f.series.flown] for f in flights]
    times = [t for t in times if len(t)] or [f.series.time for f in flights]
    return min(t[0] for t in times) - MARGIN_S, max(t[-1] for t in times) + MARGIN_S


def thin(
    time: np.ndarray, values: np.ndarray, buckets: int = BUCKETS
) -> tuple[np.ndarray, np.ndarray]:
    """Reduce a line to the lowest and the highest point of each of `buckets` intervals.

    This keeps every peak. time [s], values: (ticks,).
    """
    length = len(time) // buckets
    if length <= 2:
        return time, values
    whole = length * buckets
    blocks = np.nan_to_num(values[:whole]).reshape(buckets, length)
    first = np.arange(buckets) * length
    low, high = first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)
    rows = np.unique(np.concatenate([low, high, np.arange(whole, len(time))]))
    return time[rows], values[rows]


def stack(
    title: str,
    flights: Sequence[DrawnFlight],
    panels: Sequence[Panel],
    columns: int = 1,
    panel_height: float = 1.45,
    right: float = RIGHT,
) -> tuple[Figure, list[Axes]]:
    """Draw panels below each other (column by column), with one line per flight in each."""
    rows = -(-len(panels) // columns)
    figure, axes = grid(title, rows, columns, panel_height, right)
    ordered = list(axes.T.flat)
    for axis, panel in zip(ordered, panels, strict=True):
        lines(axis, flights, panel)
    finish(figure, axes, flights)
    return figure, ordered


def grid(
    title: str, rows: int, columns: int, panel_height: float, right: float = RIGHT
) -> tuple[Figure, np.ndarray]:
    """Return an empty grid of panels (rows, columns) with title, space for phases and legend."""
    height = rows * panel_height + 1.05
    figure = Figure(figsize=(style.WIDTH, height), layout=None)
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
    figure.subplots_adjust(
        left=0.085,
        right=right,
        top=1.0 - 0.62 / height,
        bottom=0.44 / height,
        hspace=0.16,
        wspace=0.2,
    )
    style.title(figure, title)
    return figure, axes


def lines(axis: Axes, flights: Sequence[DrawnFlight], panel: Panel) -> None:
    """Draw one column of every flight."""
    for number, flight in enumerate(flights):
        series = flight.series
        shown = slice(None) if panel.on_ground else series.flown
        width = 1.1 if number == 0 else 0.9
        axis.plot(
            *thin(series.time[shown], series[panel.column][shown] * panel.factor),
            color=style.flight_colour(number),
            linewidth=width,
            zorder=3 + len(flights) - number,
        )
    axis.set_ylabel(panel.label, parse_math=True)
    axis.yaxis.set_major_locator(MaxNLocator(nbins=4, min_n_ticks=3, symmetric=False))
    axis.margins(y=0.12)


def finish(
    figure: Figure,
    axes: np.ndarray,
    flights: Sequence[DrawnFlight],
    handles: Sequence[Line2D] | None = None,
) -> None:
    """Add phases, events, time axis and legend, common to all figures over time.

    handles: entries of the legend, instead of flights and events.
    """
    start, end = window(flights)
    axes[0, 0].set_xlim(start, end)
    first = flights[0].series
    for axis in axes.flat:
        bands(axis, first, end)
        for time, colour, _ in events(first):
            axis.axvline(time, color=colour, linewidth=0.9, linestyle=MAGNET_DASHES, zorder=2.5)
    mark_changes(axes, first, start, end)
    shade(axes, first.info, start, end)
    for axis in axes[0]:
        phase_names(figure, axis, first, start, end)
    for axis in axes[-1]:
        axis.set_xlabel("time from take-off command [s]")
    figure.align_ylabels(axes)
    if handles is None:
        legend(figure, flights, events(first))
    else:
        corner_legend(figure, handles)


def bands(axis: Axes, series: Series, end: float) -> None:
    """Shade every second phase."""
    for number, (name, begin, until) in enumerate(series.phase_spans()):
        if number % 2 == 1 and name not in ON_GROUND:
            axis.axvspan(begin, min(until, end), color=style.BAND, linewidth=0.0, zorder=0)


def phase_names(figure: Figure, axis: Axes, series: Series, start: float, end: float) -> None:
    """Write the phase names above a panel; a name that would overlap another is left out."""
    inches = figure.get_figwidth() * axis.get_position().width
    per_character = 0.068 * (end - start) / inches  # width of a 7.5 pt letter [s]
    reached = -np.inf
    for name, begin, until in series.phase_spans():
        middle, half = 0.5 * (begin + until), 0.5 * per_character * len(name)
        if name in ON_GROUND or middle - half < reached or middle + half > end + 3 * half:
            continue
        style.note(axis, name, (middle, 1.0), (0, 3), **PHASE)
        reached = middle + half + per_character


def mark_changes(axes: np.ndarray, series: Series, start: float, end: float) -> None:
    """Mark each change of parameters by a thin line (dotted: refused) and its number."""
    shown = [
        (number, one)
        for number, one in parameter_table.changes(series.info)
        if start <= one["time_s"] <= end
    ]
    for accepted, colour, dashes, _ in CHANGES:
        times = [one["time_s"] for _, one in shown if one["accepted"] == accepted]
        for axis in axes.flat if times else ():
            axis.vlines(
                times,
                0.0,
                1.0,
                transform=axis.get_xaxis_transform(),
                color=colour,
                linewidth=0.6,
                linestyle=dashes,
                zorder=2.4,
            )
    for axis in axes[0]:
        for time, label in parameter_table.labels(shown, apart=0.02 * (end - start)):
            style.note(axis, label, (time, 1.0), (2, -2), **CHANGE)


def events(series: Series) -> list[tuple[float, str, str]]:
    """Return (time [s], colour, name) of each switching of the magnet."""
    found = []
    for on, off in series.magnet_spans():
        found.append((on, style.PICK, "magnet on"))
        found.append((off, style.DROP, "magnet off"))
    return found


def legend(
    figure: Figure, flights: Sequence[DrawnFlight], marked: Sequence[tuple[float, str, str]]
) -> None:
    """Add the legend of flights and events in the upper right corner."""
    handles = flight_keys(flights)
    named = dict.fromkeys((name, colour) for _, colour, name in marked)
    handles += [style.key(name, colour, 0.9, MAGNET_DASHES) for name, colour in named]
    results = {one["accepted"] for _, one in parameter_table.changes(flights[0].series.info)}
    handles += [
        style.key(name, colour, 0.8, dashes)
        for accepted, colour, dashes, name in CHANGES
        if accepted in results
    ]
    handles += fault_handles(flights[0].series.info)
    corner_legend(figure, handles)


def flight_keys(flights: Sequence[DrawnFlight]) -> list[Line2D]:
    return [style.key(f.label, style.flight_colour(n), 1.1) for n, f in enumerate(flights)]


def corner_legend(figure: Figure, handles: Sequence[Line2D]) -> None:
    """Add one row of legend entries in the upper right corner."""
    corner = (0.99, 1.0 - 0.02 / figure.get_figheight())
    figure.legend(
        handles=handles,
        loc="upper right",
        bbox_to_anchor=corner,
        ncols=len(handles),
        handlelength=1.7,
        columnspacing=1.4,
    )
