"""One rehearsal from its settings to its metrics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from uam_lab.flight.conclude import conclude
from uam_lab.flight.direct.warm_up import prepare
from uam_lab.flight.flight_settings import FlightSettings
from uam_lab.flight.observer import Observer
from uam_lab.processes.interrupts import StopRequest
from uam_lab.rehearsal.engine import RehearsalEngine
from uam_lab.rehearsal.options import RehearsalOptions
from uam_lab.results.outcome import Outcome
from uam_lab.results.result_folder import ResultFolder
from uam_lab.vehicle.lab import Lab


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
