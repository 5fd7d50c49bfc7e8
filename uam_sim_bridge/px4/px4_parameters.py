"""The parameters that a PX4 of ours flies with: names and values, as PX4 calls them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from uam_control.settings import configuration, yaml_file
from uam_sim_bridge.px4.installation import Px4Error

FILES = ("autopilot/s500.yaml", "px4/s500.yaml")  # of config/; a later one overrides
AIRFRAME = "SYS_AUTOSTART"  # chosen before parameters are set
_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")  # MAVLink carries 16 bytes
Value = int | float


def load(files: Sequence[str | Path] | None = None) -> dict[str, Value]:
    """Read YAML files of `NAME: value` and merge them; by default those of config/.

    An integer stays one: PX4 tells its INT32 parameters by that. Raises Px4Error.
    """
    values: dict[str, Value] = {}
    for file in files or [configuration.path(name) for name in FILES]:
        values |= _read(Path(file))
    return values


def environment(values: dict[str, Value]) -> dict[str, str]:
    """The variables from which PX4's start-up script takes airframe and parameters."""
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
            raise Px4Error(f"{file}: '{name}' is no name of a PX4 parameter")
        if isinstance(value, bool) or not isinstance(value, Value) or not math.isfinite(value):
            raise Px4Error(f"{file}: {name}: {value!r} is not a number")
    return values
