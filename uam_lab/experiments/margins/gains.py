"""Adapted gains for the linear model: those of the profile, and those of a flight."""

import numpy as np

from uam_control.laws import catalogue
from uam_control.laws.modular import ZETA
from uam_control.profiles.profile import Profile
from uam_lab.records.results.timeseries import SUBSYSTEMS, Series, gain_columns

PERCENTILE = 95.0


def flown_gains(profile: Profile, series: Series) -> dict[str, np.ndarray]:
    """Return the gains of each subsystem in a flight, for the model.

    The modular law has the gain rho / max(||r||, varpi) on r, the model rho / varpi: its rho is the
    95th percentile of rho varpi / max(||r||, varpi) in flight. K0 alone gives it, because the other
    terms depend on the motion. Of the other laws each gain is the median.
    """
    found = {}
    for subsystem in SUBSYSTEMS:
        parameters = profile.sets[f"{subsystem}_controller"]
        names = catalogue.law(parameters.law).gain_names(len(parameters.inertia))
        rows = series.values[series.flown][:, gain_columns(subsystem, names, series.columns)]
        rows = rows[np.isfinite(rows).all(axis=1)]
        if not len(rows):
            continue
        if parameters.law != catalogue.DEFAULT:
            found[subsystem] = np.median(rows, axis=0)
            continue
        zeta = float(np.median(rows[:, ZETA]))
        layer = np.maximum(rows[:, names.index("r_norm")] / parameters.varpi, 1.0)
        rho = float(np.percentile(rows[:, names.index("rho")] / layer, PERCENTILE))
        found[subsystem] = np.array([max(rho - zeta, 0.0), 0.0, 0.0, 0.0, zeta])
    return found
