"""After a flight: complete the result folder with table, facts and metrics."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from typing import Any

from uam_lab.flight.flight_settings import FlightSettings
from uam_lab.results import metrics
from uam_lab.results.outcome import Outcome
from uam_lab.results.result_folder import ResultFolder, versions, write_json


def command_line() -> str:
    """Return the command line of the user."""
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


def complete(
    folder: ResultFolder, known: Mapping[str, Any], outcome: Outcome
) -> dict[str, Any] | None:
    """Write metrics, table and facts of a flight; known: its settings, see `settings_facts`."""
    if outcome.partial:
        outcome.notes.insert(0, f"partial: the recording ends with the flight ({outcome.reason})")
    info = {
        **known,
        "wall_s": outcome.wall_s,
        "abort_reason": outcome.reason,
        "partial": outcome.partial,
        "notes": outcome.notes,
        "missed_ticks": outcome.missed_ticks,
        "parameter_changes": outcome.parameter_changes,
        "transitions": outcome.transitions,
        "grasps": outcome.grasps,
        "faults": outcome.faults,
    }
    if outcome.errors_of:
        info["errors_of"] = outcome.errors_of
        text = f"errors are {outcome.errors_of} − reference: a vehicle has no simulator's truth"
        if text not in outcome.notes:
            outcome.notes.append(text)
    write_json(folder.info, info)
    if outcome.series is None:
        return None
    outcome.series.info.update(info)
    outcome.series.write(folder.timeseries)
    figures = metrics.compute(outcome.series, info, outcome.latency_s)
    write_json(folder.metrics, figures)
    return figures
