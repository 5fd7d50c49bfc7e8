"""PX4's parameters for this vehicle: PX4's names and their values, from config/."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from uam_control.settings import configuration, yaml_file
from uam_control.vehicle import VehicleDescription
from uam_sim_bridge.px4.px4_installation import Px4Error

SIMULATION = "px4/sitl.yaml"  # of config/: settings of the simulation, the same for all vehicles
AIRFRAME = "SYS_AUTOSTART"  # PX4 selects the airframe before it sets parameters
_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")  # at most 16 bytes in MAVLink
Value = int | float


def load(
    vehicle: VehicleDescription, files: Sequence[str | Path] | None = None
) -> dict[str, Value]:
    """Merge the vehicle's parameters and YAML files of `NAME: value`; files None: SIMULATION.

    Integers stay integers: PX4 requires them for INT32 parameters. Raises Px4Error.
    """
    values: dict[str, Value] = dict(vehicle.autopilot_parameters())
    for file in files or [configuration.path(SIMULATION)]:
        values |= _read(Path(file))
    return values


def environment(values: dict[str, Value]) -> dict[str, str]:
    """Return the environment variables for PX4's start-up script: airframe and parameters."""
    return {
        "PX4_SYS_AUTOSTART" if name == AIRFRAME else f"PX4_PARAM_{name}": f"{value}"
        for name, value in values.items()
    }


def _read(file: Path) -> dict[str, Value]:
    values = yaml_file.read(file, Px4Error)
    if not isinstance(values, dict):
        raise Px4Error(f"{file}: 'NAME: value' lines expected")
    for name, value in values.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise Px4Error(f"{file}: '{name}' is no PX4 parameter name: A-Z, 0-9, _, at most 16")
        if isinstance(value, bool) or not isinstance(value, Value) or not math.isfinite(value):
            raise Px4Error(f"{file}: {name}: {value!r} is not a number")
    return values
