"""What PX4 logged (ULog), in the frames and on the time base of our table.

Our names, frames (ENU, FLU) and units; time: mission time [s]. The two clocks are aligned by the
setpoints, which both sides log: the lag of the largest correlation.
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.signal import correlate, correlation_lags
from scipy.spatial.transform import Rotation

from uam_control.setpoints.thrust_curve import inverse_curve
from uam_lab.records.results.timeseries import Series, UnreadableFlight

STEP = 0.004  # [s] of the grid on which the logs are aligned
MISSING = "PX4's log is not shown: pip install pyulog"
ALIGNED = {"setpoint.thrust": 1.0, "setpoint.rate_x": 0.3, "setpoint.rate_y": 0.3}  # weights
OTHER_ORIGIN = 1.0  # [m] a larger mean distance is that of two origins
Data = Mapping[str, np.ndarray]


class UnreadableUlog(UnreadableFlight):
    """The file is no ULog, or contains nothing to align it by; the text is one line."""


@dataclass(frozen=True)
class Px4Log:
    """Columns by our names, and how well the clocks agree; a station moves PX4's origins."""

    columns: Mapping[str, tuple[np.ndarray, np.ndarray]]  # (time [s], values from our origin)
    offset: float  # mission time minus PX4's [s]
    correlation: float  # of the setpoints there, 0..1
    origins: Mapping[str, float] = field(default_factory=dict)  # ours minus PX4's [m], by column


def read(file: Path, series: Series) -> Px4Log:
    """Read the log of a flight. Raises UnreadableUlog, ImportError without pyulog, OSError."""
    from pyulog import ULog
    from pyulog.exceptions import ULogException

    try:
        log = ULog(str(file), list(TOPICS))
    except (ULogException, TypeError, ValueError, LookupError, struct.error) as error:
        raise UnreadableUlog(f"{file} is no readable ULog: {error}") from None
    columns, factor = {}, float(log.initial_parameters.get("THR_MDL_FAC", 0.0))
    for data in log.data_list:
        if data.multi_id == 0 and len(data.data["timestamp"]):
            time = 1e-6 * data.data["timestamp"]
            for name, values in TOPICS[data.name](data.data):
                if name.startswith("rotor"):  # logged before PX4's thrust curve, ours is after it
                    values = np.array([inverse_curve(factor, thrust) for thrust in values])
                if (known := np.isfinite(values)).any():
                    columns[name] = time[known], values[known]
    if not ALIGNED.keys() & columns.keys():
        raise UnreadableUlog(f"{file} has no vehicle_rates_setpoint, by which the logs are aligned")
    offset, correlation = align(series, columns)
    moved = {name: (time + offset, values) for name, (time, values) in columns.items()}
    origins = {}
    for name in moved.keys() & {"estimate.x", "estimate.y", "estimate.z"}:
        time, values = moved[name]
        shift = float(np.median(np.interp(time, series.time, series[name]) - values))
        if abs(shift) > OTHER_ORIGIN:
            origins[name], moved[name] = shift, (time, values + shift)
    return Px4Log(moved, offset, correlation, origins)


def align(
    series: Series, columns: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> tuple[float, float]:
    """Return mission time minus PX4's [s], and the correlation coefficient of the setpoints."""
    ours_grid = np.arange(series.time[0], series.time[-1], STEP)
    start = min(time[0] for time, _ in columns.values())
    end = max(time[-1] for time, _ in columns.values())
    their_grid = np.arange(start, end, STEP)
    total, ours_norm, their_norm = 0.0, 0.0, 0.0
    for name, weight in ALIGNED.items():
        if name not in columns:
            continue
        known = np.isfinite(series[name])
        ours = _grid(ours_grid, series.time[known], series[name][known])
        theirs = _grid(their_grid, *columns[name])
        scale = weight / max(np.std(ours), np.std(theirs), 1e-9)
        total = total + correlate(scale * ours, scale * theirs, method="fft")
        ours_norm += np.sum((scale * ours) ** 2)
        their_norm += np.sum((scale * theirs) ** 2)
    best = int(np.argmax(total))
    lag = correlation_lags(len(ours_grid), len(their_grid))[best]
    offset = ours_grid[0] + STEP * lag - their_grid[0]
    return float(offset), float(total[best] / max(np.sqrt(ours_norm * their_norm), 1e-12))


def _grid(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the values on the grid without their mean; 0 where nothing was logged."""
    if not len(time):
        return np.zeros_like(grid)
    known = np.isfinite(values)
    return np.interp(grid, time[known], values[known] - np.mean(values[known]), left=0.0, right=0.0)


def _attitude(data: Data) -> list[tuple[str, np.ndarray]]:
    quaternion = np.column_stack([data[f"q[{i}]"] for i in (1, 2, 3, 0)])  # x, y, z, w
    yaw, pitch, roll = Rotation.from_quat(quaternion).as_euler("ZYX").T  # NED, FRD
    turned = np.angle(np.exp(1j * (np.pi / 2.0 - yaw)))
    return [("estimate.roll", roll), ("estimate.pitch", -pitch), ("estimate.yaw", turned)]


def _rates(data: Data) -> list[tuple[str, np.ndarray]]:
    names = (("roll", 1.0), ("pitch", -1.0), ("yaw", -1.0))
    return [(f"estimate.{n}_dot", sign * data[f"xyz[{i}]"]) for i, (n, sign) in enumerate(names)]


def _rate_setpoint(data: Data) -> list[tuple[str, np.ndarray]]:
    return [
        ("setpoint.rate_x", data["roll"]),
        ("setpoint.rate_y", -data["pitch"]),
        ("setpoint.rate_z", -data["yaw"]),
        ("setpoint.thrust", -data["thrust_body[2]"]),
    ]


def _position(data: Data) -> list[tuple[str, np.ndarray]]:
    ours = (("x", data["y"], "xy"), ("y", data["x"], "xy"), ("z", -data["z"], "z"))
    return [
        (f"estimate.{name}", np.where(data[f"{valid}_valid"] != 0, values, np.nan))
        for name, values, valid in ours
    ]


def _motors(data: Data) -> list[tuple[str, np.ndarray]]:
    numbers = (i for i in range(12) if np.isfinite(data[f"control[{i}]"]).any())
    # NaN: the motor stands
    return [(f"rotor_{i + 1}.command", np.nan_to_num(data[f"control[{i}]"])) for i in numbers]


# topic of PX4 → its columns under our names
TOPICS: dict[str, Callable[[Data], list[tuple[str, np.ndarray]]]] = {
    "vehicle_attitude": _attitude,
    "vehicle_angular_velocity": _rates,
    "vehicle_rates_setpoint": _rate_setpoint,
    "vehicle_local_position": _position,
    "actuator_motors": _motors,
}
