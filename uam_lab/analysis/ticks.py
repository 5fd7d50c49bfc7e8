"""Which ticks of a flight the analysis looks at: in the air, thinned, and whether with payload."""

from __future__ import annotations

import numpy as np

from uam_control.laws.modular import ADAPTATION
from uam_lab.results.timeseries import SUBSYSTEMS, Series, gain_columns

CLEARANCE = 0.01  # [m] above where the vehicle stood: no ground under its feet
LIFTED = 0.001  # [m] above where the payload stood: nothing but the magnet carries it
FIRM = 0.5  # of the magnet's largest force: less and there is an air gap
FREQUENCY = 50.0  # [Hz]
NEEDED = ("truth.", "estimate.", "reference.", "tau_", "rotor_")
FEWEST = 10  # ticks; below that there is nothing to say


def in_the_air(series: Series, frequency: float = FREQUENCY) -> np.ndarray:
    """Row numbers (m,), ascending, thinned to `frequency` [Hz]; empty if it never flew.

    On the ground the feet carry the weight, which the paper's model does not have.
    """
    if len(series) < FEWEST:
        return np.zeros(0, dtype=int)
    flown = series.flown & (series["truth.z"] > series["truth.z"][0] + CLEARANCE)
    gains = np.hstack([series.values[:, gain_columns(s, ADAPTATION)] for s in SUBSYSTEMS])
    complete = np.logical_and.reduce(
        [np.isfinite(block).all(axis=1) for block in (*map(series.block, NEEDED), gains)]
    )
    rows = np.flatnonzero(flown & complete)
    return rows[:: max(1, round(1.0 / (frequency * period(series))))]


def period(series: Series) -> float:
    """Time between two ticks [s]."""
    return float(np.median(np.diff(series.time)))


def carrying(series: Series) -> np.ndarray:
    """Mask (ticks,): the payload hangs on the magnet, and on nothing else."""
    force, height = series["magnet.force"], series["payload.z"]
    on = np.flatnonzero(np.nan_to_num(series["magnet.on"]) > 0.5)
    if not len(on) or not np.isfinite(height[on[0]]):
        return np.zeros(len(series), dtype=bool)
    firm = np.nan_to_num(force) > FIRM * np.nanmax(force)
    held = firm & (height > height[on[0]] + LIFTED)
    # before it was first lifted the stand bears it; later it may hang lower than the stand
    return firm & np.logical_or.accumulate(held)
