"""The picture of a campaign: distribution of the errors, and their dependence on each value."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from uam_lab.experiments.campaign.flown import Flown
from uam_lab.experiments.campaign.statistics import Bin, sliced
from uam_lab.report.figures import style

MARKED = 300  # largest number of flights that are drawn one by one
COLUMNS = 4  # of small pictures
LEAST = 1e-6  # [m, deg] smallest error of the logarithmic axis


def picture(flights: Flown, vehicle: str) -> Figure:
    """Draw a violin per coordinate and, below, two small pictures per drawn value."""
    rows = -(-len(flights.drawn) // COLUMNS)
    figure = Figure(figsize=(style.WIDTH, 2.6 + 3.0 * rows), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(2.6, 3.0 * rows))
    _distributions(top.subplots(), flights, vehicle)
    small = bottom.subplots(2 * rows, COLUMNS, squeeze=False)
    for axis in small.flat[2 * rows * COLUMNS - 1 :: -1]:
        axis.set_visible(False)
    for k, (name, values) in enumerate(flights.drawn.items()):
        row, column = divmod(k, COLUMNS)
        upper, lower = small[2 * row, column], small[2 * row + 1, column]
        bins = sliced(values, flights.failed, flights.error)
        _completed(upper, bins)
        _errors(lower, bins, values, flights)
        lower.set_xlabel(name)
        for axis in (upper, lower):
            axis.set_visible(True)
            axis.set_xlim(values.min(), max(values.max(), values.min() + 1e-9))
        if column == 0:
            upper.set_ylabel("completed [%]")
            lower.set_ylabel("position RMS [m]")
    return figure


def _distributions(axis: Axes, flights: Flown, vehicle: str) -> None:
    logs = [np.log10(np.maximum(c[np.isfinite(c)], LEAST)) for c in flights.rms.T]
    shown = [k for k, column in enumerate(logs) if column.size]
    if shown:
        axis.violinplot([logs[k] for k in shown], [k + 1 for k in shown], showmedians=True)
        low, high = min(logs[k].min() for k in shown), max(logs[k].max() for k in shown)
        ticks = range(int(np.floor(low)), int(np.ceil(high)) + 1)
        axis.set(yticks=list(ticks), yticklabels=[f"{10.0**k:g}" for k in ticks])
    axis.set(xticks=range(1, len(logs) + 1), xticklabels=flights.names, ylabel="RMS [m, deg]")
    text = f"{vehicle}: {len(flights)} random flights, {flights.failed.sum()} not completed"
    axis.set_title(text, loc="left")


def _steps(bins: list[Bin]) -> np.ndarray:
    return np.array([edge for one in bins for edge in (one.low, one.high)])


def _completed(axis: Axes, bins: list[Bin]) -> None:
    """Draw the share of completed flights of each bin, with its confidence band."""
    share, low, high = (100.0 * np.repeat([b.completed[k] for b in bins], 2) for k in range(3))
    axis.fill_between(_steps(bins), low, high, color=style.FLIGHTS[0], alpha=0.25, linewidth=0)
    axis.plot(_steps(bins), share, color=style.FLIGHTS[0])
    axis.set_ylim(min(90.0, low.min() - 1.0), 100.5)


def _errors(axis: Axes, bins: list[Bin], values: np.ndarray, flights: Flown) -> None:
    """Draw median and 5 to 95 % of the error of each bin; single flights where they are few."""
    low, middle, high = (np.repeat([b.error[k] for b in bins], 2) for k in range(3))
    axis.fill_between(_steps(bins), low, high, color=style.FLIGHTS[0], alpha=0.25, linewidth=0)
    axis.plot(_steps(bins), middle, color=style.FLIGHTS[0])
    failed = np.flatnonzero(flights.failed)[:MARKED]
    if len(flights) <= MARKED:
        done = ~flights.failed
        axis.plot(values[done], flights.error[done], ".", color=style.MUTED, markersize=2)
    axis.plot(values[failed], flights.error[failed], "x", color=style.DROP, markersize=3)
    if np.isfinite(flights.error).any():
        axis.set_yscale("log")
