"""Errors phase by phase, those of the trajectory alone, and those of the end effector.

epsilon is the distance of the vehicle from its reference, rho = epsilon / L with the arm's reach L,
from the shoulder to the end effector: Suarez, Vega, Ollero 2020, "Benchmarks for aerial
manipulation" (RA-L).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from uam_control.coordinates import POSITION
from uam_lab.records.results.hand_columns import ERROR
from uam_lab.records.results.timeseries import Series

TRAJECTORY = "trajectory"  # phase of the scenario at its full speed
WITH_RAMPS = ("run-up", TRAJECTORY, "run-out")
BEFORE, AFTER = 4.0, 8.0  # [s] around a switch of the gripper, while the load changes

Figure = Callable[[np.ndarray], Any]  # of errors (m,) or (m, n), over the ticks


def by_phase(series: Series, groups: tuple[tuple[str, slice, float], ...]) -> list[dict[str, Any]]:
    """Return the figures of every phase of the flight, in order of their begins.

    groups: see `metrics.GROUPS`. A phase that returns, after a hold, is one entry; seconds: its
    length in all.
    """
    order = dict.fromkeys(name for name, _, _ in series.phase_spans())
    masks = {name: series.flown & series.in_phase(name) for name in order}
    return [
        {"phase": name} | figures(series, mask, groups)
        for name, mask in masks.items()
        if mask.any()
    ]


def with_ramps(
    series: Series, groups: tuple[tuple[str, slice, float], ...]
) -> dict[str, Any] | None:
    """Return the figures of the trajectory and its ramps, None without a trajectory."""
    rows = with_ramps_rows(series)
    return figures(series, rows, groups) if rows.any() else None


def with_ramps_rows(series: Series) -> np.ndarray:
    """Return the mask (ticks,) of the trajectory and its ramps; nothing without a trajectory."""
    if not (series.flown & series.in_phase(TRAJECTORY)).any():
        return np.zeros(len(series), dtype=bool)
    return series.flown & np.any([series.in_phase(name) for name in WITH_RAMPS], axis=0)


def distance(series: Series, rows: np.ndarray) -> np.ndarray:
    """Return the distance (m,) [m] of the vehicle to the reference at the ticks `rows`, a mask."""
    return np.linalg.norm(series.block("error.")[rows][:, POSITION], axis=1)


def root_mean_square(values: np.ndarray) -> float:
    """Return the root mean square of values (m,); NaN without any."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else np.nan


def figures(
    series: Series, rows: np.ndarray, groups: tuple[tuple[str, slice, float], ...]
) -> dict[str, Any]:
    """Return the figures of the ticks `rows` (ticks,), a mask with one tick or more.

    position_3d_m: root mean square of the distance to the reference; largest_3d_m: largest
    distance; tilt_deg, thrust_n: largest true tilt, and largest sum of the rotors' thrusts; in rms
    and max: see `rms` and `largest`.
    """
    error, times = series.block("error.")[rows], series.time[rows]
    away = distance(series, rows)
    thrust = sum(
        series[name][rows]
        for name in series.columns.names
        if name.startswith("rotor_") and name.endswith(".thrust")
    )
    period = float(np.median(np.diff(series.time))) if len(series) > 1 else 0.0
    return {
        "from_s": round(float(times[0]), 6),
        "seconds": round(period * len(times), 6),
        "position_3d_m": root_mean_square(away),
        "largest_3d_m": float(away.max()),
        "rms": {
            key: (factor * np.sqrt(np.mean(error[:, columns] ** 2, axis=0))).tolist()
            for key, columns, factor in groups
        }
        | rms(series, rows),
        "max": largest(series, rows),
        "tilt_deg": float(np.degrees(series.tilt[rows].max())),
        "thrust_n": float(np.max(thrust)),
    }


def rms(series: Series, rows: np.ndarray) -> dict[str, Any]:
    """Return the root mean squares at the ticks `rows`, a mask; {} without an end effector."""
    return _figures(series, rows, lambda errors: np.sqrt(np.mean(np.square(errors), axis=0)))


def largest(series: Series, rows: np.ndarray) -> dict[str, Any]:
    """Return the largest magnitudes at the ticks `rows`, a mask; {} without an end effector."""
    return _figures(series, rows, lambda errors: np.max(np.abs(errors), axis=0))


def load_steps(series: Series) -> dict[str, Any] | None:
    """Return the `largest` errors around the last lift of a payload, and around its set-down; None
    without a grip."""
    spans = series.magnet_spans()
    if not spans:
        return None
    switched = zip(("lift", "set_down"), spans[-1], strict=True)
    around = {
        name: (series.time - at >= -BEFORE) & (series.time - at <= AFTER) for name, at in switched
    }
    return {name: largest(series, series.flown & rows) for name, rows in around.items()}


def _figures(series: Series, rows: np.ndarray, figure: Figure) -> dict[str, Any]:
    if f"{ERROR}.x" not in series.columns or not rows.any():
        return {}
    place = series.block(f"{ERROR}.")[rows][:, POSITION]
    heading = np.degrees(series[f"{ERROR}.heading"][rows])
    away = np.linalg.norm(series.block("error.")[rows][:, POSITION], axis=1)
    epsilon = float(figure(away))
    return {
        "end_effector_m": figure(place).tolist(),
        "end_effector_norm_m": float(figure(np.linalg.norm(place, axis=1))),
        "end_effector_heading_deg": float(figure(heading)),
        "epsilon_m": epsilon,
        "rho": epsilon / series.info.get("arm_reach_m", np.nan),
    }
