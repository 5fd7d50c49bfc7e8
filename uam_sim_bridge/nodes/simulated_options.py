"""Parameters of every node that runs a plant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from uam_control.settings.json_text import read_mapping
from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    integer,
    number,
    text,
    vector,
)
from uam_sim_bridge.plant.vehicle import PAYLOAD_MAX


@dataclass(frozen=True)
class SimulatedParameters(ParameterSet):
    """The vehicle as simulated, its payload and its noise, the autopilot's port."""

    vehicle_changes: str = text(
        "{}", "dotted entries of the vehicle's file to replace", 'JSON, as {"air.gust": 1.0}'
    )
    payload_mass: float = number(0.2, "mass of the payload, 0 for none", "kg", 0.0, PAYLOAD_MAX)
    seed: int = integer(1, "seed of all noise", 0, 2**31 - 1)
    arm_start: tuple = vector(
        (),
        "joint angles on the ground, empty = stowed as described",
        "rad",
        -math.pi,
        math.pi,
        optional=True,
    )
    hil_port: int = integer(4560, "TCP port at which the autopilot connects", 1, 65535)
    statistics: str = text("", "JSON file to write at the end", "a file; empty: none")

    def changes(self) -> dict[str, Any]:
        """Return the entries to replace, for `Vehicle.changed`; raises ParameterError."""
        expected = 'vehicle_changes: JSON expected, as {"air.gust": 1.0}'
        return read_mapping(self.vehicle_changes, ParameterError, expected)
