"""The analysis of a flight in a result folder, with the parameters that it was flown with."""

from __future__ import annotations

from pathlib import Path

from uam_control.profiles.profile import load_profile
from uam_lab.analysis.stability import Stability, analyse
from uam_lab.results.timeseries import Series
from uam_sim_bridge.plant import Vehicle

LAW = "modular"


def analyse_folder(directory: Path, series: Series) -> Stability | None:
    """None where another law flew or the vehicle hardly left the ground.

    Raises ProfileError where parameters.yaml is missing or not a profile of the modular law.
    """
    info = series.info
    if info.get("controller", LAW) != LAW:
        return None
    sets = load_profile(str(directory / "parameters.yaml")).sets
    vehicle = Vehicle.load().changed(info.get("vehicle_changes") or {})
    return analyse(series, sets, vehicle, info.get("payload_mass_kg") or 0.0)
