"""What the flights of a campaign depend on, by name: a resumed campaign must have the same."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterable, Mapping
from pathlib import Path

from uam_control.laws.catalogue import LAWS
from uam_control.settings import configuration
from uam_control.vehicle import VehicleDescription
from uam_lab.experiments.trials.carried import files_of_model
from uam_lab.experiments.workers.identity import identity


def inputs(
    vehicle: VehicleDescription, scenario: str, further: Mapping[str, object]
) -> dict[str, str]:
    """Return name → digest of all inputs of flights of this vehicle and scenario (name or file).

    further: options, profiles and others, which differ by their repr.
    """
    laws = [Path(inspect.getsourcefile(law)) for law in LAWS.values()]
    named = {
        **further,
        "vehicle": vehicle.numbers,
        "autopilot gains": vehicle.autopilot_gains,
        "model (MJCF and its files)": _content(
            file for model in vehicle.models for file in files_of_model(model)
        ),
        "scenario": _content([configuration.named("scenarios", scenario)]),
        "laws": _content(laws),
        **identity(),
    }
    return {name: _short(value) for name, value in named.items()}


def _short(value: object) -> str:
    if isinstance(value, str) and len(value) <= 16:
        return value
    return hashlib.sha256(repr(value).encode()).hexdigest()[:12]


def _content(files: Iterable[Path]) -> list[tuple[str, str]]:
    return [(file.name, hashlib.sha256(file.read_bytes()).hexdigest()) for file in files]
