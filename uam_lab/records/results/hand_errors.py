"""Errors of the end effector, and the deviation of the vehicle, of some ticks of a flight.

epsilon is the distance of the vehicle from its reference, rho = epsilon / L with the arm's reach L,
from the shoulder to the end effector: Suarez, Vega, Ollero 2020, "Benchmarks for aerial
manipulation" (RA-L).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from uam_control.coordinates import POSITION
from uam_lab.records.results.hand_columns import ERROR
from uam_lab.records.results.timeseries import Series

BEFORE, AFTER = 4.0, 8.0  # [s] around a switch of the gripper, while the load changes

Figure = Callable[[np.ndarray], Any]  # of errors (m,) or (m, n), over the ticks


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
