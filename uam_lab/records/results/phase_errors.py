"""Errors phase by phase, those of the trajectory alone, and those of the end effector.

epsilon is the distance of the vehicle from its reference, rho = epsilon / L with the arm's reach L,
from the shoulder to the end effector: Suarez, Vega, Ollero 2020, "Benchmarks for aerial
manipulation" (RA-L).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_lab.records.results.timeseries import ERROR, Series

TRAJECTORY = "trajectory"  # phase of the scenario at its full speed
WITH_RAMPS = ("run-up", TRAJECTORY, "run-out")
BEFORE, AFTER = 4.0, 8.0  # [s] around a switch of the gripper, while the load changes

Figure = Callable[[np.ndarray], Any]  # of errors (m,) or (m, n), over the ticks
# (key, columns of the error block, factor from SI to the unit that the key names)
GROUPS = (
    ("position_m", POSITION, 1.0),
    ("attitude_deg", ATTITUDE, 180.0 / np.pi),
    ("arm_deg", ARM, 180.0 / np.pi),
)


def rms(errors: np.ndarray) -> np.ndarray:
    """Return the root mean square (n,) over the rows of errors (ticks, n); NaN without rows."""
    return np.sqrt(np.mean(np.square(errors), axis=0)) if len(errors) else _nothing(errors)


def largest(errors: np.ndarray) -> np.ndarray:
    """Return the largest magnitude (n,) over the rows of errors (ticks, n); NaN without rows."""
    return np.max(np.abs(errors), axis=0) if len(errors) else _nothing(errors)


def _nothing(errors: np.ndarray) -> np.ndarray:
    return np.full(errors.shape[1:], np.nan)[()]


def by_group(series: Series, rows: np.ndarray, figure: Figure) -> dict[str, list[float]]:
    """Return a figure of the tracking errors at the ticks `rows`, a mask, in the group's unit."""
    error = series.block("error.")[rows]
    return {key: (factor * figure(error[:, columns])).tolist() for key, columns, factor in GROUPS}


def by_phase(series: Series) -> list[dict[str, Any]]:
    """Return the figures of every phase of the flight, in order of their begins.

    A phase that returns, after a hold, is one entry; seconds: its length in all.
    """
    order = dict.fromkeys(name for name, _, _ in series.phase_spans())
    masks = {name: series.flown & series.in_phase(name) for name in order}
    return [{"phase": name} | figures(series, mask) for name, mask in masks.items() if mask.any()]


def with_ramps(series: Series) -> dict[str, Any] | None:
    """Return the figures of the trajectory and its ramps, None without a trajectory."""
    rows = with_ramps_rows(series)
    return figures(series, rows) if rows.any() else None


def with_ramps_rows(series: Series) -> np.ndarray:
    """Return the mask (ticks,) of the trajectory and its ramps; nothing without a trajectory."""
    if not (series.flown & series.in_phase(TRAJECTORY)).any():
        return np.zeros(len(series), dtype=bool)
    return series.flown & np.any([series.in_phase(name) for name in WITH_RAMPS], axis=0)


def distance(series: Series, rows: np.ndarray) -> np.ndarray:
    """Return the distance (m,) [m] of the vehicle to the reference at the ticks `rows`, a mask."""
    return np.linalg.norm(series.block("error.")[rows][:, POSITION], axis=1)


def figures(series: Series, rows: np.ndarray) -> dict[str, Any]:
    """Return the figures of the ticks `rows` (ticks,), a mask with one tick or more.

    position_3d_m: root mean square of the distance to the reference; largest_3d_m: largest
    distance; tilt_deg, thrust_n: largest true tilt, and largest sum of the rotors' thrusts.
    """
    away, times = distance(series, rows), series.time[rows]
    thrust = sum(
        series[name][rows]
        for name in series.columns.names
        if name.startswith("rotor_") and name.endswith(".thrust")
    )
    period = float(np.median(np.diff(series.time))) if len(series) > 1 else 0.0
    return {
        "from_s": round(float(times[0]), 6),
        "seconds": round(period * len(times), 6),
        "position_3d_m": rms(away),
        "largest_3d_m": float(away.max()),
        "rms": by_group(series, rows, rms) | of_hand(series, rows, rms),
        "max": of_hand(series, rows, largest),
        "tilt_deg": float(np.degrees(series.tilt[rows].max())),
        "thrust_n": float(np.max(thrust)),
    }


def load_steps(series: Series) -> dict[str, Any] | None:
    """Return the largest errors around the last lift of a payload, and around its set-down; None
    without a grip."""
    spans = series.magnet_spans()
    if not spans:
        return None
    switched = zip(("lift", "set_down"), spans[-1], strict=True)
    around = {
        name: (series.time - at >= -BEFORE) & (series.time - at <= AFTER) for name, at in switched
    }
    return {name: of_hand(series, series.flown & rows, largest) for name, rows in around.items()}


def of_hand(series: Series, rows: np.ndarray, figure: Figure) -> dict[str, Any]:
    """Return a figure of the end effector's errors at the ticks `rows`, a mask; {} without one."""
    if f"{ERROR}.x" not in series.columns or not rows.any():
        return {}
    place = series.block(f"{ERROR}.")[rows][:, POSITION]
    heading = np.degrees(series[f"{ERROR}.heading"][rows])
    epsilon = float(figure(distance(series, rows)))
    return {
        "end_effector_m": figure(place).tolist(),
        "end_effector_norm_m": float(figure(np.linalg.norm(place, axis=1))),
        "end_effector_heading_deg": float(figure(heading)),
        "epsilon_m": epsilon,
        "rho": epsilon / series.info.get("arm_reach_m", np.nan),
    }
