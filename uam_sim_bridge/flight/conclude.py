"""After a flight: the result folder is completed, and metrics.json says how it went."""

from __future__ import annotations

from typing import Any

from uam_sim_bridge.flight import metrics
from uam_sim_bridge.flight.outcome import Outcome
from uam_sim_bridge.flight.result_folder import ResultFolder
from uam_sim_bridge.flight.settings import FlightSettings


def facts(settings: FlightSettings, outcome: Outcome, command: str) -> dict[str, Any]:
    """What is known about a flight beside its table."""
    scenario = settings.scenario
    return {
        "controller": settings.controller,
        "profile": settings.profile.name,
        "scenario": scenario.name,
        "engine": settings.engine,
        "clock": settings.clock,
        "autopilot": settings.autopilot,
        "seed": settings.seed,
        "payload_mass_kg": settings.payload_mass,
        "vehicle_changes": settings.vehicle_changes,
        "wall_s": outcome.wall_s,
        "abort_reason": outcome.reason,
        "partial": outcome.partial,
        "notes": outcome.notes,
        "missed_ticks": outcome.missed_ticks,
        "drop_point": list(scenario.drop_point) if scenario.drop_point else None,
        "snapshots": [list(snapshot) for snapshot in scenario.snapshots],
        "command": command,
    }


def conclude(
    settings: FlightSettings, folder: ResultFolder, outcome: Outcome, command: str
) -> dict[str, Any] | None:
    """Write metrics, table and facts; returns the metrics, None where nothing was recorded."""
    if outcome.partial:
        outcome.notes.insert(0, f"partial: the recording ends with the flight ({outcome.reason})")
    info = facts(settings, outcome, command)
    folder.write_info(info)
    folder.write_versions()
    if outcome.series is None:
        return None
    outcome.series.info.update(info)
    folder.write_series(outcome.series)
    figures = metrics.compute(outcome.series, info, outcome.latency_s)
    folder.write_metrics(figures)
    return figures
