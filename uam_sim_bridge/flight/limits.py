"""How long a flight may take, in whichever engine."""

from __future__ import annotations

from uam_control.mission import Scenario

OVERTIME = 60.0  # [s] simulated, beyond the scenario's landing, until a flight is ended


def time_limit(scenario: Scenario) -> float:
    """Simulation time [s] at which a flight of this scenario ends in any case."""
    return scenario.landing.at + scenario.landing.duration + OVERTIME
