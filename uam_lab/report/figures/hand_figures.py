"""The end effector: path against reference, error over time, workspace; a joint's friction."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from uam_lab.records.results.phase_errors import WITH_RAMPS
from uam_lab.records.results.timeseries import ERROR, REFERENCE, TRUTH, Series
from uam_lab.report.figures import panels, style
from uam_lab.report.figures.panels import DrawnFlight, Panel, corner_legend, flight_keys
from uam_sim_bridge.devices.dynamixel.friction_fit import FrictionFit

HEIGHT = 3.6  # [in]
VIEWS = ("xy", "xz", "xyz")  # from above, from the side, in space
MOST = 3000  # points of a path
DEGREES = 180.0 / np.pi
# from the left, from behind, from above
SIDES = (("x", "z"), ("y", "z"), ("x", "y"))


def hand_errors(flights: Sequence[DrawnFlight]) -> Figure | None:
    """Draw the error of the end effector over time; return None if a flight has none."""
    if not _all_have(flights):
        return None
    drawn = [Panel(f"{axis} error [mm]", f"{ERROR}.{axis}", 1e3) for axis in "xyz"]
    drawn.append(Panel("heading error [°]", f"{ERROR}.heading", DEGREES))
    figure, axes = panels.stack("End effector error", flights, drawn)
    for axis in axes:
        axis.axhline(0.0, color=style.REFERENCE, linewidth=0.8, zorder=2)
    return figure


def hand_path(flights: Sequence[DrawnFlight]) -> Figure | None:
    """Draw the path of the end effector from two sides and in space; None if a flight has none."""
    if not _all_have(flights):
        return None
    figure = Figure(figsize=(style.WIDTH, HEIGHT))
    figure.subplots_adjust(left=0.08, right=0.97, top=0.86, bottom=0.14, wspace=0.3)
    style.title(figure, "Path of the end effector")
    places = figure.add_gridspec(1, len(VIEWS), width_ratios=[max(1.0, len(v) / 2) for v in VIEWS])
    for place, view in zip(places, VIEWS, strict=True):
        axes = figure.add_subplot(place, projection="3d" if view[2:] else None)
        for number, flight in enumerate(flights):
            rows = _shown(flight.series)
            if number == 0:
                wanted = (flight.series[f"{REFERENCE}.{one}"][rows] for one in view)
                axes.plot(*wanted, color=style.REFERENCE, linewidth=1.2, linestyle="--", zorder=6)
            true = (flight.series[f"{TRUTH}.{one}"][rows] for one in view)
            axes.plot(*true, color=style.flight_colour(number), linewidth=1.2, zorder=7)
        axes.set(**{f"{at}label": f"{one} [m]" for at, one in zip("xyz", view, strict=False)})
        axes.set_aspect("equal", adjustable="datalim")
    reference = style.key("reference", style.REFERENCE, 1.1, "--")
    corner_legend(figure, [reference, *flight_keys(flights)])
    return figure


def _all_have(flights: Sequence[DrawnFlight]) -> bool:
    return all(f"{ERROR}.x" in flight.series.columns for flight in flights)


def _shown(series: Series) -> np.ndarray:
    """Return the rows of the trajectory with its ramps, without one those of the flight."""
    ramps = series.flown & np.any([series.in_phase(name) for name in WITH_RAMPS], axis=0)
    rows = np.flatnonzero(ramps if ramps.any() else series.flown)
    return rows[:: max(1, len(rows) // MOST)]


def draw_workspace(file: Path, name: str, places: np.ndarray) -> None:
    """Write the picture of the places (m, 3) [m], base frame, that it reaches, as PNG."""
    with style.styled():
        figure = Figure(figsize=(11.0, 4.0), layout="constrained")
        for axes, (across, up) in zip(figure.subplots(1, 3), SIDES, strict=True):
            shown = places[:, "xyz".index(across)], places[:, "xyz".index(up)]
            axes.plot(*shown, ".", color=style.FLIGHTS[0], markersize=1)
            axes.plot(0.0, 0.0, "+", color=style.INK)
            axes.set_xlabel(f"{across} [m]")
            axes.set_ylabel(f"{up} [m]")
            axes.set_aspect("equal", adjustable="datalim")
        figure.suptitle(f"{name}: reach of the end effector; +: origin of the base")
        style.save(figure, file)


SHOWN = 4000  # dots


def draw_friction(file: Path, joint: str, fit: FrictionFit) -> None:
    """Write the picture as PNG."""
    with style.styled():
        figure = Figure(figsize=(7.0, 4.5), layout="constrained")
        axes = figure.subplots()
        every = max(1, len(fit.velocity) // SHOWN)
        dots = {"color": style.FLIGHTS[0], "markersize": 2, "label": "measured"}
        axes.plot(fit.velocity[::every], fit.torque[::every], ".", **dots)
        fastest = float(np.max(np.abs(fit.velocity)))
        label = f"{fit.coulomb:.3f} N m and {fit.viscous:.4f} N m s/rad"
        for speeds in (np.array([-fastest, -1e-6]), np.array([1e-6, fastest])):
            fitted = fit.coulomb * np.sign(speeds) + fit.viscous * speeds
            axes.plot(speeds, fitted, color=style.INK, linewidth=1.5, label=label)
            label = None
        scale = f"torque scale {fit.scale:.3f}" if fit.scale_known else "torque scale unknown"
        axes.set_title(f"{joint}: friction, {scale}", loc="left")
        axes.set_xlabel("velocity [rad/s]")
        axes.set_ylabel("torque without weight and inertia [N m]")
        axes.legend()
        style.save(figure, file)
