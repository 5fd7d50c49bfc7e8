"""After a flight: complete the result folder with table, facts and metrics."""

import shlex
import sys
from typing import Any

from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.records.results.outcome import Outcome, complete
from uam_lab.records.results.result_folder import ResultFolder, versions, write_json


def command_line() -> str:
    return shlex.join(["uam", *sys.argv[1:]])


def settings_facts(settings: FlightSettings) -> dict[str, Any]:
    """Return the settings of a flight as facts for info.json and the log."""
    scenario = settings.scenario
    return {
        "controller": settings.controller,
        "profile": settings.profile.name,
        "scenario": scenario.name,
        "scenario_options": settings.scenario_options.to_mapping(),
        "engine": settings.engine,
        "layout": settings.layout if settings.engine == "ros" else None,
        "plant": settings.plant,
        "clock": settings.clock,
        "imu": settings.imu,
        "autopilot": settings.autopilot,
        "namespace": settings.namespace,
        "seed": settings.seed,
        "payload_mass_kg": settings.payload_mass,
        "vehicle": settings.vehicle.source,
        "vehicle_changes": settings.vehicle_changes,
        **scenario.surroundings,
        "drop_point": list(scenario.drop_point) if scenario.drop_point else None,
        "landing_point": list(scenario.landing_point) if scenario.landing_point else None,
        "snapshots": [list(snapshot) for snapshot in scenario.snapshots],
        "faults_planned": settings.faults.entries,
        "command": settings.command,
    }


def conclude(
    settings: FlightSettings, folder: ResultFolder, outcome: Outcome
) -> dict[str, Any] | None:
    """Write metrics, table and facts; return the metrics, None if nothing was recorded."""
    write_json(folder.versions, versions())
    outcome.notes.extend(settings.notes)
    return complete(folder, settings_facts(settings), outcome)
