"""Figures of a study."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from adapting.description import NOMINAL, Study
from adapting.flights import StudyResult
from adapting.report import mean, of
from adapting.run import Swept
from uam_lab.records.results.timeseries import SUBSYSTEMS
from uam_lab.report.figures import style

matplotlib.use("Agg")

COLOURS = (
    *style.FLIGHTS[:2],
    style.FLIGHTS[2],
    style.INK,
    *style.FLIGHTS[3:],
    "#57a773",
    "#0b3c6f",
)
DASHES = ("-", (0, (4, 1.5)), (0, (1, 1.2)))
LABELS = ("position [m]", "attitude [deg]", "arm [deg]")
HALF = 0.6  # [deg] half of the paper's arm columns, rounded


def errors(study: Study, results: Sequence[StudyResult]) -> Figure:
    """Draw each subsystem's error over each factor, one line per row."""
    factors = study.document["factors"]
    figure = Figure(figsize=(style.WIDTH + 2.4, 7.6))
    axes = figure.subplots(3, len(factors), sharey="row", sharex="col")
    for column, (factor, text) in enumerate(factors.items()):
        base = study.document["nominal_values"][factor]
        points = sorted(
            [(base, NOMINAL)] + [(c.value, c.label) for c in study.conditions if c.of == factor]
        )
        for part in range(3):
            axis = axes[part, column]
            for number, row in enumerate(study.rows):
                own = [of(results, row.label, label) for _, label in points]
                y = np.array([mean(one, part) for one in own])
                if np.isnan(y).all():
                    continue
                colour, dash = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
                x = [value for value, _ in points]
                axis.plot(x, y, color=colour, linestyle=dash, marker=".", markersize=5)
                bad = [not all(r.flown for r in one) for one in own]
                axis.plot(np.array(x)[bad], y[bad], "x", color=colour, markersize=7)
            axis.set_yscale("log")
            if column == 0:
                axis.set_ylabel(LABELS[part])
        axes[2, column].set_xlabel(text)
    handles = [
        style.key(row.label, COLOURS[i % len(COLOURS)], dashes=DASHES[i % len(DASHES)])
        for i, row in enumerate(study.rows)
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3)
    figure.subplots_adjust(left=0.085, right=0.99, top=0.93, bottom=0.19, wspace=0.08, hspace=0.1)
    style.title(figure, "RMS errors, one factor varied at a time (x: not flown to the end)")
    return figure


def shares(study: Study, results: Sequence[StudyResult], condition: str) -> Figure:
    """Draw the shares of the coupling as bars: adaptation, feedback, autopilot and integral."""
    figure = Figure(figsize=(style.WIDTH, 4.0))
    axes = figure.subplots(1, 3, sharey=True)
    terms = (("adaptive", "adaptation of the law"), ("feedback", "feedback"))
    terms += (("actuators", "autopilot and motors"), ("added", "integral action, known loads"))
    rows = list(reversed(study.rows))
    for axis, subsystem in zip(axes, SUBSYSTEMS, strict=True):
        for place, row in enumerate(rows):
            own = of(results, row.label, condition)
            found = [r.shares[subsystem] for r in own if subsystem in r.shares]
            positive = negative = 0.0
            for number, (term, _) in enumerate(terms):
                values = [one[term] for one in found if one[term] is not None]
                value = 100.0 * float(np.mean(values)) if values else 0.0
                left = positive if value >= 0.0 else negative
                axis.barh(place, value, left=left, color=style.FLIGHTS[number], height=0.7)
                positive, negative = positive + max(value, 0.0), negative + min(value, 0.0)
        axis.axvline(50.0, color=style.INK, linewidth=0.8, linestyle=(0, (3, 2)))
        axis.set_title(subsystem, loc="left")
        axis.set_xlabel("share of the coupling [%]")
    axes[0].set_yticks(range(len(rows)), [row.label for row in rows])
    handles = [style.key(text, style.FLIGHTS[i], 6.0) for i, (_, text) in enumerate(terms)]
    figure.legend(handles=handles, loc="lower center", ncols=4)
    figure.subplots_adjust(left=0.3, right=0.985, top=0.84, bottom=0.22, wspace=0.08)
    style.title(figure, f"Who carries the coupling: flight {condition}")
    return figure


def law(found: Sequence[Swept]) -> Figure:
    """Draw errors and delay margins over boundary layer, nu and delay."""
    figure = Figure(figsize=(style.WIDTH, 8.0))
    kinds = list(dict.fromkeys(one.what for one in found))
    flights = list(dict.fromkeys(one.result.condition for one in found))
    axes = figure.subplots(4, len(kinds), sharex="col", sharey="row")
    texts = {
        "layer": "factor on varpi (ceilings of K as they are)",
        "nu": "factor on nu",
        "delay": "delay of the setpoints [ms]",
    }
    for column, kind in enumerate(kinds):
        for number, flight in enumerate(flights):
            own = [o for o in found if o.what == kind and o.result.condition == flight]
            x = np.array([one.value for one in own])
            lost = np.array([not one.result.flown for one in own])
            for part in range(3):
                y = np.array([one.result.errors[part] for one in own])
                axes[part, column].plot(x, y, ".-", color=style.FLIGHTS[number], label=flight)
                axes[part, column].plot(x[lost], y[lost], "x", color=style.FLIGHTS[number], ms=8)
        own = [one for one in found if one.what == kind and one.result.condition == flights[0]]
        x = [one.value for one in own]
        bottom = axes[3, column]
        late = np.array(x) if kind == "delay" else 0.0
        bottom.plot(x, 1e3 * np.array([o.arm_delay for o in own]), ".-", color=style.FLIGHTS[2])
        left = 1e3 * np.array([o.setpoint_delay for o in own]) - late
        bottom.plot(x, left, ".-", color=style.FLIGHTS[3])
        bottom.set_yscale("symlog", linthresh=1.0)
        if kind != "delay":
            bottom.set_xscale("log")
        bottom.set_xlabel(texts[kind])
    for part in range(3):
        axes[part, 0].set_ylabel(LABELS[part])
        axes[part, 0].set_yscale("log")
    axes[3, 0].set_ylabel("delay margin [ms]")
    axes[0, 0].legend(loc="best")
    keys = [style.key("arm", style.FLIGHTS[2]), style.key("setpoints", style.FLIGHTS[3])]
    axes[3, 0].legend(handles=keys, loc="best")
    figure.subplots_adjust(left=0.1, right=0.985, top=0.94, bottom=0.07, wspace=0.08, hspace=0.12)
    style.title(figure, "The proposed law: boundary layer, nu, delay (x: not flown to the end)")
    return figure


def arm(found: Sequence[Swept]) -> Figure:
    """Draw the arm's error over its delay margin, one line per row."""
    figure = Figure(figsize=(style.WIDTH, 4.0))
    axis = figure.subplots()
    for number, what in enumerate(dict.fromkeys(one.what for one in found)):
        own = [one for one in found if one.what == what]
        x = [1e3 * one.arm_delay for one in own]
        y = [one.result.errors[2] for one in own]
        axis.plot(x, y, ".-", color=style.FLIGHTS[number], label=what)
        for one, at in zip(own, zip(x, y, strict=True), strict=True):
            axis.annotate(
                f"× {one.value:g}",
                at,
                (4, 3),
                textcoords="offset points",
                fontsize=7.5,
                color=style.FLIGHTS[number],
            )
            if not one.result.flown:
                axis.plot(*at, "x", color=style.FLIGHTS[number], markersize=9)
    axis.axhline(HALF, color=style.INK, linewidth=0.8, linestyle=(0, (3, 2)))
    axis.annotate(
        "half of the paper's row", (1.0, HALF), (-4, 3), xycoords=("axes fraction", "data"),
        textcoords="offset points", ha="right", fontsize=8.0,
    )  # fmt: skip
    axis.set(yscale="log", xlabel="delay margin of the arm loops, largest gains [ms]")
    axis.set_ylabel("worst joint, RMS [deg]")
    axis.legend(loc="best")
    figure.subplots_adjust(left=0.08, right=0.985, top=0.88, bottom=0.14)
    style.title(figure, "The arm in the paper's mission, 0.2 kg: stiffness against delay margin")
    return figure


def tuning(costs: dict[str, Sequence[float]]) -> Figure:
    """Draw the cost of every evaluation, and the best so far, per law."""
    figure = Figure(figsize=(style.WIDTH, 3.4))
    axis = figure.subplots()
    for number, (name, values) in enumerate(costs.items()):
        x = np.arange(1, len(values) + 1)
        axis.plot(x, values, ".", color=style.FLIGHTS[number], alpha=0.5)
        best = np.minimum.accumulate(values)
        axis.step(x, best, where="post", color=style.FLIGHTS[number], label=name)
    axis.set(xlabel="evaluation", ylabel="cost", yscale="log")
    axis.legend(loc="best")
    figure.subplots_adjust(left=0.08, right=0.985, top=0.87, bottom=0.15)
    style.title(figure, "Search of the adaptation's own numbers")
    return figure
