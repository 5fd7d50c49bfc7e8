"""The figures of one flight or of several flights overlaid: the paper's five and more.

`draw(flights, directory)` writes them as PNG, as SVG, and for plotly.js as JSON; each figure has
its own function.
"""

import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from uam_control.coordinates import coordinates
from uam_control.laws import catalogue
from uam_control.laws.law import GainGroup
from uam_control.settings.atomic import write_text
from uam_lab.records.results import metrics
from uam_lab.records.results.phase_errors import GROUPS
from uam_lab.records.results.timeseries import AXES, SUBSYSTEMS
from uam_lab.report.facts import paper
from uam_lab.report.figures import panels, style
from uam_lab.report.figures.hand_figures import hand_errors, hand_path
from uam_lab.report.figures.panels import DrawnFlight, Panel
from uam_lab.report.figures.path_figure import path_figure
from uam_lab.report.figures.stability_figures import coupling, lyapunov
from uam_lab.report.figures.zoomable import zoomable

DEGREES = 180.0 / np.pi
TURNS = ("roll", "pitch", "yaw")
# our column → label, factor to its unit; rotors follow
DRAWN = {
    **{f"estimate.{axis}": (f"{axis} [°]", DEGREES) for axis in TURNS},
    **{f"estimate.{axis}_dot": (f"{axis} rate [°/s]", DEGREES) for axis in TURNS},
    **{f"setpoint.rate_{axis}": (f"rate setpoint {axis} [°/s]", DEGREES) for axis in "xyz"},
    **{f"estimate.{axis}": (f"{axis} [m]", 1.0) for axis in "xyz"},
    "setpoint.thrust": ("thrust setpoint", 1.0),
}


def px4_log(flights: Sequence[DrawnFlight]) -> Figure | None:
    """Draw attitude, rates, setpoints, position and motors of both logs; None without PX4's."""
    if len(flights) != 1 or flights[0].px4 is None:
        return None
    series, log = flights[0].series, flights[0].px4
    rotors = [f"rotor_{i}.command" for i in range(1, series.columns.rotors + 1)]
    drawn = DRAWN | {name: (f"motor {i}", 1.0) for i, name in enumerate(rotors, start=1)}
    shown = {name: how for name, how in drawn.items() if name in log.columns}
    title = f"PX4's log beside ours (correlation of the setpoints {log.correlation:.2f})"
    figure, axes = panels.grid(title, math.ceil(len(shown) / 3), 3, 1.4)
    figure.subplots_adjust(wspace=0.32)
    for axis, (name, (label, factor)) in zip(axes.flat, shown.items(), strict=False):
        time, values = log.columns[name]
        axis.plot(*panels.thin(time, factor * values), color=style.FLIGHTS[1], linewidth=1.3)
        axis.plot(
            *panels.thin(series.time, factor * series[name]), color=style.FLIGHTS[0], linewidth=0.8
        )
        axis.set_ylabel(label)
        if name in log.origins:
            text = f"PX4 {log.origins[name]:+.1f} m: its origin"
            axis.set_title(text, fontsize=7, loc="left", pad=2, color=style.FLIGHTS[1])
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    keys = [style.key("ours", style.FLIGHTS[0]), style.key("PX4", style.FLIGHTS[1], 1.4)]
    panels.finish(figure, axes, flights, keys)
    return figure


ANGLES = {"roll": "roll φ", "pitch": "pitch θ", "yaw": "yaw ψ"}  # in a label


def tracking_errors(group: int, flights: Sequence[DrawnFlight]) -> Figure:
    """Draw the errors of one of GROUPS over time, as in the paper's plot1, plot3 and plot5; of a
    single flight with its RMS and the paper's beside them."""
    key, block, factor = GROUPS[group]
    _, heading, unit, digits, labels = paper.tables(_joints(flights))[group]
    drawn = [
        Panel(f"{ANGLES.get(label, label)} error [{unit}]", f"error.{name}", factor)
        for label, name in zip(labels, coordinates(_joints(flights))[block], strict=True)
    ]
    title, single = f"{heading.capitalize()} tracking error", len(flights) == 1
    figure, axes = panels.stack(title, flights, drawn, right=0.875 if single else panels.RIGHT)
    if single:
        own = metrics.errors(flights[0].series)[key]
        for axis, value, published in zip(axes, own, paper.published(key, len(own)), strict=True):
            _beside(axis, 0.74, "RMS")
            text = f"{value:.{digits}f} {unit}".replace(" °", "°")
            _beside(axis, 0.58, text, fontsize=10.5, color=style.INK)
            if published is not None:
                _beside(axis, 0.42, f"paper {published:g} {unit}".replace(" °", "°"))
    for axis in axes:
        axis.axhline(0.0, color=style.REFERENCE, linewidth=0.8, zorder=2)
    return figure


def _beside(axis: Axes, height: float, text: str, **look: Any) -> None:
    look = {"fontsize": 7.5, "color": style.MUTED, "va": "center", **look}
    axis.text(1.02, height, text, transform=axis.transAxes, **look)


position_errors, attitude_errors, arm_errors = (partial(tracking_errors, k) for k in range(3))


def _joints(flights: Sequence[DrawnFlight]) -> int:
    """Return the number of joints that all of the flights have."""
    return min(flight.series.columns.joints for flight in flights)


def vehicle_inputs(flights: Sequence[DrawnFlight]) -> Figure:
    """Draw tau_p and tau_q over time, as in the paper's plot6."""
    drawn = [Panel(f"$\\tau_{{p,{axis}}}$ [N]", f"tau_p.{axis}") for axis in "xyz"]
    drawn += [
        Panel(f"$\\tau_{{q,\\{symbol}}}$ [N m]", f"tau_q.{name}")
        for symbol, name in (("phi", "roll"), ("theta", "pitch"), ("psi", "yaw"))
    ]
    return panels.stack("Vehicle control inputs", flights, drawn, columns=2)[0]


def arm_inputs(flights: Sequence[DrawnFlight]) -> Figure:
    """Draw tau_alpha over time, as in the paper's plot7."""
    drawn = [
        Panel(f"$\\tau_{{\\alpha {joint}}}$ [N m]", f"tau_alpha.{joint}")
        for joint in range(1, _joints(flights) + 1)
    ]
    return panels.stack("Arm control inputs", flights, drawn)[0]


def setpoints(flights: Sequence[DrawnFlight]) -> Figure:
    """Draw the setpoints sent to the autopilot."""
    drawn = [
        Panel(f"{name} rate [°/s]", f"setpoint.rate_{axis}", DEGREES)
        for name, axis in (("roll", "x"), ("pitch", "y"), ("yaw", "z"))
    ]
    drawn.append(Panel("thrust [1]", "setpoint.thrust"))
    drawn.append(Panel("true / assumed [1]", "thrust.factor"))
    return panels.stack("Setpoints sent to the autopilot", flights, drawn, panel_height=1.25)[0]


def payload(flights: Sequence[DrawnFlight]) -> Figure | None:
    """Draw the position of the payload; return None if no flight had one."""
    flights = [f for f in flights if not np.isnan(f.series["payload.z"]).all()]
    if not any(f.series.info.get("payload_mass_kg") for f in flights):
        return None
    drawn = [Panel(f"payload {axis} [m]", f"payload.{axis}", on_ground=True) for axis in "xyz"]
    return panels.stack("Payload", flights, drawn, panel_height=1.15)[0]


def adaptation(flights: Sequence[DrawnFlight]) -> Figure | None:
    """Draw the adapted gains and their inputs by subsystem; return None without any."""
    most = max(AXES, *(flight.series.columns.joints for flight in flights))
    shown = [
        group
        for group in catalogue.gain_groups(most)
        if group.label and any(_adapted(f, group.names) for f in flights)
    ]
    if not shown:
        return None
    figure, axes = panels.grid("Adaptation", len(shown), 3, 1.65)
    for column, subsystem in enumerate(("position", "attitude", "arm")):
        for number, flight in enumerate(flights):
            for axis, group in zip(axes[:, column], shown, strict=True):
                _adaptation_of(axis, flight, subsystem, group, number, len(flights))
        top = {"xycoords": "axes fraction", "fontweight": "bold"}
        style.note(axes[0, column], subsystem, (0.0, 1.0), (0, 14), **top)
    for row, group in zip(axes, shown, strict=True):
        row[0].set_ylabel(group.label, parse_math=True)
        if len(group.names) > 1:
            _gain_legend(row[2], group, above=1.06 if group == shown[0] else 0.97)
        for axis in () if group.signed else row:
            axis.set_yscale("log")
            low, high = axis.get_ylim()
            axis.set_ylim(10.0 ** np.floor(np.log10(low)), 10.0 ** np.ceil(np.log10(high)))
            axis.yaxis.set_minor_formatter(NullFormatter())
    panels.finish(figure, axes, flights)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return figure


def _gain_legend(axis: Axes, group: GainGroup, above: float) -> None:
    """Add the legend of a row of gains; in the first row it is above the phase names."""
    lines = zip(style.GAINS, group.names, strict=False)
    legend = axis.legend(
        handles=[style.key(f"${group.symbol}_{name[-1]}$", c, 1.1) for c, name in lines],
        loc="lower right",
        bbox_to_anchor=(1.02, above),
        ncols=len(group.names),
        handlelength=1.0,
        columnspacing=0.8,
        fontsize=8.0,
    )
    style.formulas(legend)


def _adapted(flight: DrawnFlight, names: tuple[str, ...]) -> bool:
    """Return whether the flight has any of these gains, in any subsystem: one that is not zero."""
    return any(
        np.nan_to_num(flight.series[column]).any()
        for column in (f"adaptation.{s}.{name}" for s in SUBSYSTEMS for name in names)
        if column in flight.series.columns
    )


def _adaptation_of(
    axis: Axes, flight: DrawnFlight, subsystem: str, group: GainGroup, number: int, flights: int
) -> None:
    series = flight.series
    for i, name in enumerate(group.names):
        if (column := f"adaptation.{subsystem}.{name}") not in series.columns:
            continue  # of a flight with fewer joints than another
        values = series[column]
        shown = series.flown & (np.isfinite(values) if group.signed else values > 0.0)
        if shown.any():
            several = len(group.names) > 1  # then the colour marks the gain, the dash the flight
            axis.plot(
                *panels.thin(series.time[shown], values[shown], 400),
                color=style.GAINS[i] if several else style.flight_colour(number),
                linestyle=("-", "--", ":", "-.")[number % 4] if several and flights > 1 else "-",
                linewidth=1.0,
            )


# file name → (figure, caption in the report), in the order of the page
FIGURES: dict[str, tuple[Callable[[Sequence[DrawnFlight]], Figure | None], str]] = {
    "position_errors": (position_errors, "Position error, truth minus reference."),
    "attitude_errors": (
        attitude_errors,
        "Attitude error; the reference of roll and pitch is the desired attitude of tau_p.",
    ),
    "arm_errors": (arm_errors, "Joint error of the arm, truth minus reference."),
    "end_effector_path": (
        hand_path,
        "The end effector from above, from the side and in space, during the trajectory with its "
        "ramps if there is one.",
    ),
    "end_effector_errors": (hand_errors, "Error of the end effector, truth minus reference."),
    "vehicle_inputs": (vehicle_inputs, "Force and torque commands of the two vehicle laws."),
    "arm_inputs": (arm_inputs, "Joint torque commands of the arm law."),
    "path": (path_figure, "Vehicle, arm and payload in the plane of the mission."),
    "payload": (payload, "The payload on its stand, on the magnet and on the mat."),
    "adaptation": (adaptation, "Adapted gains and their inputs, in flight."),
    "coupling": (
        coupling,
        "The plant's true coupling force on each axis, minus the weight fed forward, and the terms "
        "that compensate it: the adaptive term, the feedback, and the difference between actuators "
        "and command (for the attitude: the integrator of the autopilot). Means over 0.2 s.",
    ),
    "lyapunov": (
        lyapunov,
        "The Appendix's Lyapunov functions with the constants K* of this flight, their three "
        "terms, the solution of the proof's differential inequality, and the ultimate bound.",
    ),
    "setpoints": (
        setpoints,
        "Body rates and collective thrust sent to the autopilot; ratio of the true thrust to that "
        "of the assumed thrust curve, as identified in flight.",
    ),
    "px4_log": (
        px4_log,
        "What PX4 logged (ULog) beside our log, in our frames; the clocks are aligned by the "
        "setpoints. PX4 logs them at its own, lower rate.",
    ),
}


def draw(
    flights: Sequence[DrawnFlight],
    directory: Path,
    progress: Callable[[str], None] = lambda text: None,
    names: Sequence[str] | None = None,
) -> list[str]:
    """Write the figures (all, or those of `names`) to `directory`; return the names written."""
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    with style.styled():
        for name in names or FIGURES:
            progress(f"figure {name}")
            figure = FIGURES[name][0](flights)
            if figure is None:
                continue
            for suffix, metadata in ((".png", None), (".svg", {"Date": None})):
                style.save(figure, directory / (name + suffix), metadata=metadata)
            write_text(directory / f"{name}.json", json.dumps(zoomable(figure)))
            written.append(name)
    return written
