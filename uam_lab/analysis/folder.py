"""Analyse the flight in a result folder with the parameters stored beside it."""

from __future__ import annotations

from pathlib import Path

from uam_control.laws.modular import ModularLaw
from uam_control.profiles.profile import load_profile
from uam_control.vehicle import DEFAULT_VEHICLE, load_description
from uam_lab.analysis.stability import Stability, analyse
from uam_lab.results.timeseries import Series
from uam_sim_bridge.plant import Vehicle

LAW = ModularLaw.kind.law


def analyse_folder(directory: Path, series: Series) -> Stability | None:
    """Return the analysis, or None for another law or for a flight with too few airborne ticks.

    Raises ProfileError if parameters.yaml is missing or is no profile of the modular law.
    """
    info = series.info
    if info.get("controller", LAW) != LAW:
        return None
    described = load_description(info.get("vehicle") or DEFAULT_VEHICLE)
    sets = load_profile(str(directory / "parameters.yaml"), vehicle=described).sets
    vehicle = Vehicle.of(described).changed(info.get("vehicle_changes") or {})
    return analyse(series, sets, vehicle, info.get("payload_mass_kg") or 0.0)
