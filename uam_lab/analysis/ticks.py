"""Selection of the ticks for the analysis: airborne, thinned out, with or without payload."""

from collections.abc import Sequence

import numpy as np

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
