"""Figure: what PX4 logged beside our log."""

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from uam_lab.report.figures import panels, style
from uam_lab.report.figures.panels import DrawnFlight

DEGREES = math.degrees(1.0)
AXES = ("roll", "pitch", "yaw")
# our column → label, factor to its unit; rotors follow
DRAWN = {
    **{f"estimate.{axis}": (f"{axis} [°]", DEGREES) for axis in AXES},
    **{f"estimate.{axis}_dot": (f"{axis} rate [°/s]", DEGREES) for axis in AXES},
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
