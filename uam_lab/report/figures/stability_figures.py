"""Figures of the stability analysis: V and its bounds, coupling and compensating terms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from uam_control.coordinates import ALPHA
from uam_lab.records.results.timeseries import SUBSYSTEMS
from uam_lab.report.figures import panels, style
from uam_lab.report.figures.panels import DrawnFlight

if TYPE_CHECKING:
    from uam_lab.analysis.lyapunov_bound import ComparisonSystem

SYMBOLS = {"position": "p", "attitude": "q", "arm": "\\alpha"}
BOUND, ENVELOPE = (0, (6, 2)), (0, (1, 1.4))
LOWEST = 1e-6  # lower limit of the drawn tracking term, which may be zero
MEAN_S = 0.2  # [s] averaging time of the forces, against the noise of the estimate
BUCKETS = 400  # of a line
COUPLING, ADAPTIVE, FEEDBACK, INTEGRAL = style.INK, *style.FLIGHTS[:3]
ACTUATORS = "#9aa5af"
_COLOURS = np.roll(style.GAINS[:4], -1)
TERMS = dict(zip(("tracking", "gains", "$\\zeta$", "$\\hat\\theta$"), _COLOURS, strict=True))


def lyapunov(flights: Sequence[DrawnFlight]) -> Figure | None:
    """Draw V, V_p, V_q, V_alpha with terms and bounds; None unless one analysis is given."""
    found = _only(flights)
    if found is None:
        return None
    figure, axes = panels.grid("Lyapunov function of the Appendix", 4, 1, 1.7, right=0.985)
    total, *each = axes[:, 0]
    _bounded(total, found.time, found.total, found.comparison)
    total.set_ylabel("$V$", parse_math=True)
    for axis, name in zip(each, SUBSYSTEMS, strict=True):
        subsystem = found.subsystems[name]
        parts = subsystem.parts
        terms = parts.tracking, parts.gains, parts.zeta, parts.bias
        for values, colour in zip(terms, TERMS.values(), strict=True):
            if not values.any():
                continue
            drawn = panels.thin(found.time, np.maximum(values, LOWEST), BUCKETS)
            axis.plot(*drawn, color=colour, linewidth=0.9)
        _bounded(axis, found.time, parts.total, subsystem.comparison)
        axis.set_ylabel(f"$V_{{{SYMBOLS[name]}}}$", parse_math=True)
    handles = [
        style.key("$V$", style.INK, 1.5),
        *(style.key(term, colour) for term, colour in TERMS.items()),
        style.key("$\\dot V\\leq-\\varrho V+\\gamma$", style.DROP, 1.0, ENVELOPE),
        style.key("ultimate bound", style.DROP, 1.0, BOUND),
    ]
    panels.finish(figure, axes, flights, handles)
    style.formulas(figure.legends[0])
    return figure


def coupling(flights: Sequence[DrawnFlight]) -> Figure | None:
    """Draw the true coupling force and its compensation; None unless one analysis is given."""
    found = _only(flights)
    if found is None:
        return None
    joints = found.supply.tau.shape[1] - ALPHA
    figure, axes = panels.grid("Coupling and its compensation", 3 + math.ceil(joints / 2), 2, 1.45)
    figure.subplots_adjust(wspace=0.26)  # small torques have long labels
    supply = found.supply
    drawn = (
        (supply.applied - supply.tau, ACTUATORS, 0.9),
        (supply.feedback, FEEDBACK, 0.9),
        (supply.integral, INTEGRAL, 0.9),
        (supply.adaptive, ADAPTIVE, 1.2),
        (found.coupling.plant, COUPLING, 1.2),
    )
    labels = [f"{axis} [N]" for axis in "xyz"]
    labels += [f"{name} [N m]" for name in ("roll φ", "pitch θ", "yaw ψ")]
    labels += [f"$\\alpha_{joint}$ [N m]" for joint in range(1, joints + 1)]
    # left x, y, z, right the angles, below them the joints from left to right
    used = [*axes[:3].T.flat, *axes[3:].flat]
    for column, (axis, label) in enumerate(zip(used, labels, strict=False)):
        for values, colour, width in drawn:
            if colour == ACTUATORS and column >= ALPHA:
                continue  # the servos' torque is not recorded
            mean = moving_mean(found.time, values[:, column])
            axis.plot(*panels.thin(found.time, mean, BUCKETS), color=colour, linewidth=width)
        axis.set_ylabel(label, parse_math=True)
        axis.yaxis.set_major_locator(MaxNLocator(nbins=4, min_n_ticks=3))
        axis.margins(y=0.12)
    handles = [
        style.key("true coupling", COUPLING, 1.4),
        style.key("adaptive", ADAPTIVE, 1.4),
        style.key("feedback Λξ", FEEDBACK),
        style.key("integral", INTEGRAL),
        style.key("actuators − τ", ACTUATORS),
    ]
    panels.finish(figure, axes, flights, handles)
    if joints % 2:  # the time axis of the right column is one panel higher
        axes[-1, 1].set_visible(False)
        axes[-2, 1].tick_params(labelbottom=True)
        axes[-2, 1].set_xlabel(axes[-1, 1].get_xlabel())
    return figure


def moving_mean(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the mean of values (m,) over MEAN_S around each time (m,) [s]; shorter at the ends."""
    width = max(1, round(MEAN_S / float(np.median(np.diff(time)))))
    if len(values) <= width:
        return values
    weight = np.ones(width)
    full = np.convolve(values, weight, mode="same")
    return full / np.convolve(np.ones(len(values)), weight, mode="same")


def _only(flights: Sequence[DrawnFlight]):
    return flights[0].stability if len(flights) == 1 else None


def _bounded(axis: Axes, time: np.ndarray, value: np.ndarray, comparison: ComparisonSystem) -> None:
    """Draw V, its ultimate bound and the solution of the differential inequality."""
    axis.plot(*panels.thin(time, value, BUCKETS), color=style.INK, linewidth=1.5, zorder=4)
    envelope = comparison.envelope(value[0], time - time[0])
    axis.plot(
        *panels.thin(time, envelope, BUCKETS),
        color=style.DROP,
        linewidth=1.0,
        linestyle=ENVELOPE,
        zorder=3.5,
    )
    limit = max(value[0], comparison.bound)
    axis.axhline(limit, color=style.DROP, linewidth=1.0, linestyle=BOUND, zorder=3)
    axis.set_yscale("log")
    axis.yaxis.set_major_locator(LogLocator(numticks=5))
    axis.yaxis.set_minor_locator(NullLocator())
