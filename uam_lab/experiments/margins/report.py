"""The margins of several cases as a table, as JSON, and as Bode and step plots."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_control.settings.atomic import write_text
from uam_lab.experiments.margins.cases import Case, smallest_delay
from uam_lab.experiments.margins.loops import GROWTH, Analysis, GrowingMode, step_response
from uam_lab.records.results.result_folder import write_json
from uam_lab.records.results.templates import markdown_table, shown
from uam_lab.report.figures import style

HEAD = ("loop", "crossover rad/s", "bandwidth Hz", "phase deg", "gain dB", "delay ms", "peak")
DASHES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)))
# part of chi, length of the step plot [s], lowest and highest frequency of the Bode plot [rad/s]
PANELS = ((POSITION, 4.0, 0.1, 100.0), (ATTITUDE, 1.0, 1.0, 600.0), (ARM, 0.6, 1.0, 600.0))


def table(cases: Sequence[Case]) -> str:
    """Return the margins of all cases in Markdown."""
    parts = []
    for case in cases:
        rho = ", ".join(f"{name} {value:.3g}" for name, value in case.rho.items())
        parts += [
            f"{case.label}; rho: {rho}; {_mode(case.analysis.mode)}; "
            f"without dry friction of the joints {_mode(case.sliding)}",
            markdown_table(HEAD, _rows(case.analysis)),
        ]
    delay, label = smallest_delay(cases)
    parts.append(f"Delay margin of the setpoint path: {1e3 * delay:.1f} ms ({label}).")
    return "\n\n".join(parts)


def _rows(found: Analysis) -> Iterator[list[str]]:
    for name, (_, m) in found.loops.items():
        gain = f"{shown(m.gain, 1)} / -{shown(m.gain_down, 1)}"
        row = [name, shown(m.crossover, 2), shown(m.bandwidth, 2), shown(m.phase, 1), gain]
        yield [*row, shown(1e3 * m.delay, 1), shown(m.peak, 2)]
    for name, delay in (("all setpoints", found.setpoint_delay), ("hand", found.hand_delay)):
        if delay is not None:
            yield [name, "", "", "", "", shown(1e3 * delay, 1), ""]


def document(cases: Sequence[Case], facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of margins.json: SI units, angles and gains as in `Margins`."""
    entries = [
        {
            "case": case.label,
            "stable": case.analysis.stable,
            "fastest_mode": case.analysis.mode._asdict(),
            "fastest_mode_without_friction": case.sliding._asdict(),
            "rho": case.rho,
            "setpoint_delay_s": case.analysis.setpoint_delay,
            "hand_delay_s": case.analysis.hand_delay,
            "loops": {name: asdict(m) for name, (_, m) in case.analysis.loops.items()},
        }
        for case in cases
    ]
    return {**facts, "setpoint_delay_s": smallest_delay(cases)[0], "cases": entries}


def write(out: Path, cases: Sequence[Case], facts: Mapping[str, Any]) -> None:
    """Write margins.md, margins.json, bode.png and step.png."""
    write_text(out / "margins.md", table(cases) + "\n")
    write_json(out / "margins.json", document(cases, facts))
    with style.styled():
        style.save(bode(cases), out / "bode.png")
        style.save(steps(cases), out / "step.png")


def bode(cases: Sequence[Case]) -> Figure:
    """Draw |L| and its phase for the loops of position, attitude and arm, one line per case."""
    figure = Figure(figsize=(style.WIDTH, 5.6))
    axes = figure.subplots(2, 3, sharex="col")
    for column, (part, _, low, high) in enumerate(PANELS):
        names = cases[0].stack.coordinates[part]
        size, phase = axes[:, column]
        for number, case in enumerate(cases):
            omega = case.analysis.omega
            within = (omega >= low) & (omega <= high)
            for i, name in enumerate(names):
                loop = case.analysis.loops[name][0][within]
                look = {"color": style.flight_colour(i), "linestyle": DASHES[number % len(DASHES)]}
                size.semilogx(omega[within], 20.0 * np.log10(np.abs(loop)), **look)
                phase.semilogx(omega[within], _phase(loop), **look)
        size.axhline(0.0, color=style.INK, linewidth=0.7)
        phase.axhline(-180.0, color=style.INK, linewidth=0.7)
        size.set_ylim(-40.0, 40.0)
        phase.set_ylim(-360.0, 0.0)
        phase.set_yticks(np.arange(-360.0, 1.0, 90.0))
        phase.set_xlabel("rad/s")
        _legend(size, names)
    axes[0, 0].set_ylabel("|L| [dB]")
    axes[1, 0].set_ylabel("phase [deg]")
    _finish(figure, cases, "Open loops, the others closed")
    return figure


def steps(cases: Sequence[Case]) -> Figure:
    """Draw the response of each coordinate to a unit step of its desired value."""
    figure = Figure(figsize=(style.WIDTH, 3.6))
    for axis, (part, length, _, _) in zip(figure.subplots(1, 3), PANELS, strict=True):
        names = cases[0].stack.coordinates[part]
        for number, case in enumerate(cases):
            for i, name in enumerate(names):
                time, value = step_response(case.stack, case.analysis, name, length)
                dashes = DASHES[number % len(DASHES)]
                axis.plot(time, value, color=style.flight_colour(i), linestyle=dashes)
        axis.axhline(1.0, color=style.REFERENCE, linewidth=0.8)
        axis.set_ylim(-0.5, 2.0)
        axis.set_xlabel("s")
        _legend(axis, names)
    _finish(figure, cases, "Step of the desired value, through the feedback alone")
    return figure


def _phase(loop: np.ndarray) -> np.ndarray:
    """Return the phase (k,) [deg] of L, unwrapped, within -360 to 0 at its crossover."""
    phase = np.degrees(np.unwrap(np.angle(loop)))
    at = int(np.argmin(np.abs(np.log(np.abs(loop)))))
    return phase - 360.0 * math.ceil(phase[at] / 360.0)


def _legend(axis: Axes, names: Sequence[str]) -> None:
    handles = [style.key(name, style.flight_colour(i)) for i, name in enumerate(names)]
    axis.legend(handles=handles, loc="upper right")


def _finish(figure: Figure, cases: Sequence[Case], title: str) -> None:
    handles = [
        style.key(case.label, style.MUTED, dashes=DASHES[i % len(DASHES)])
        for i, case in enumerate(cases)
    ]
    figure.legend(handles=handles, loc="lower center", ncols=2)
    height = figure.get_figheight()
    figure.subplots_adjust(
        left=0.07, right=0.985, top=1.0 - 0.4 / height, bottom=0.95 / height, wspace=0.22
    )
    style.title(figure, title)


def _mode(mode: GrowingMode) -> str:
    if mode.growth < GROWTH:
        return "stable"
    return f"UNSTABLE ({mode.growth:+.2g} 1/s at {mode.frequency:.3g} rad/s)"
