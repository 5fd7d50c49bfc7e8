"""One rehearsal from its settings to its metrics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from uam_lab.flights.conclude import conclude
from uam_lab.flights.direct.warm_up import prepare
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.observer import Observer
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.rehearsal.engine import RehearsalEngine
from uam_lab.flights.rehearsal.options import RehearsalOptions
from uam_lab.flights.vehicle.lab import Lab
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder


def fly(
    lab: Lab,
    settings: FlightSettings,
    options: RehearsalOptions,
    observer: Observer,
    stop: StopRequest,
) -> tuple[Path, Outcome, dict[str, Any] | None]:
    """Rehearse; return result folder, outcome and metrics, None if nothing was recorded.

    Raises ResultFolderError, PortError, LabError.
    """
    prepare(observer.message)
    folder = ResultFolder.create(settings.scenario.name, "rehearsal", settings.out)
    outcome = RehearsalEngine(lab, options).fly(settings, folder, observer, stop)
    return folder.path, outcome, conclude(settings, folder, outcome)
