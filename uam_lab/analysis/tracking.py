"""The airborne ticks that are analysed, and the tracking errors there by the law's definition."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ATTITUDE
from uam_control.laws.errors import tracking_errors
from uam_control.laws.modular import ModularLaw
from uam_lab.records.results.timeseries import SUBSYSTEMS, Series, gain_columns

CLEARANCE = 0.01  # [m] above the start position: the feet have no ground contact
LIFTED = 0.001  # [m] above the payload's start position: only the magnet carries it
FIRM = 0.5  # fraction of the magnet's largest force; below it there is an air gap
FREQUENCY = 50.0  # [Hz]
NEEDED = ("truth.", "estimate.", "reference.", "tau_", "rotor_")
FEWEST = 10  # ticks that the analysis needs


def in_the_air(series: Series) -> np.ndarray:
    """Return the airborne rows (m,), ascending, thinned to FREQUENCY; may be empty.

    Rows on the ground are left out: the paper's model has no ground contact.
    """
    names = ModularLaw.gain_names(0)  # those that every subsystem has
    gains = [series.values[:, gain_columns(s, names, series.columns)] for s in SUBSYSTEMS]
    return airborne(series, gains)


def airborne(series: Series, further: Sequence[np.ndarray] = ()) -> np.ndarray:
    """Return the rows of `in_the_air` for any law; further: blocks (ticks, ..) without gaps, too"""
    if len(series) < FEWEST or not series.flown.any():
        return np.zeros(0, dtype=int)
    flown = series.flown & (series["truth.z"] > series["truth.z"][0] + CLEARANCE)
    complete = np.logical_and.reduce(
        [np.isfinite(block).all(axis=1) for block in (*map(series.block, NEEDED), *further)]
    )
    rows = np.flatnonzero(flown & complete)
    return rows[:: max(1, round(1.0 / (FREQUENCY * period(series))))]


def period(series: Series) -> float:
    """Return the time between two ticks [s]."""
    return float(np.median(np.diff(series.time)))


def carrying(series: Series) -> np.ndarray:
    """Return the mask (ticks,) of the ticks in which only the magnet carries the payload."""
    force, height = series["magnet.force"], series["payload.z"]
    on = np.flatnonzero(np.nan_to_num(series["magnet.on"]) > 0.5)
    if not len(on) or not np.isfinite(height[on[0]]):
        return np.zeros(len(series), dtype=bool)
    firm = np.nan_to_num(force) > FIRM * np.nanmax(force)
    held = firm & (height > height[on[0]] + LIFTED)
    # the stand carries the payload until its first lift; later it may hang lower than the stand
    return firm & np.logical_or.accumulate(held)


@dataclass(frozen=True)
class Tracking:
    """Tracking errors at m ticks: eq. (5), err; e_q: (14), (15). SI units, world (p), FLU (q)."""

    e: np.ndarray  # (m, 8)
    e_dot: np.ndarray  # (m, 8)
    acceleration_d: np.ndarray  # (m, 8) chi_d_ddot as the law feeds it forward
    xi: np.ndarray  # (m,) ||xi|| of the whole vehicle
    acceleration: np.ndarray  # (m,) ||chi_ddot||
    rate: np.ndarray  # (m,) ||chi_dot||
    reference_rate: np.ndarray  # (m,) ||chi_d_dot||


def along(series: Series, rows: np.ndarray, source: str, printed: bool) -> Tracking:
    """Return the errors at `rows` (m,). source: "truth" or "estimate".

    printed: use e_q_dot as in eq. (15). The desired attitude is that of the same tick.
    """
    size = series.columns.size
    states = np.ascontiguousarray(series.block(f"{source}.")[rows]).reshape(-1, 3, size)
    references = np.ascontiguousarray(series.block("reference.")[rows]).reshape(-1, 3, size)
    errors = np.zeros((len(rows), 3, size))
    norms = np.zeros((len(rows), 3))
    for k in range(len(rows)):
        attitude = np.ascontiguousarray(references[k, :, ATTITUDE])
        tracking_errors(states[k], references[k], attitude, True, printed, errors[k], norms[k])
    e, e_dot, feedforward = errors.transpose(1, 0, 2)
    reference_rate = np.linalg.norm(references[:, 1], axis=1)
    return Tracking(e, e_dot, feedforward, *norms.T, reference_rate)
