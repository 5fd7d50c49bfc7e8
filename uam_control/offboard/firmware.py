"""Firmwares of autopilots: how each numbers its modes, names its parameters, words its refusals.

A firmware is a folder of config/ after config/px4. Its files: `firmware.yaml`, and those that it
has of `advice.yaml`, `passing.yaml` and `events.yaml` (texts), `vehicle.yaml` (required
parameters). A new one is such a folder and an entry in `FIRMWARES`.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uam_control.offboard.modes import CUSTOM_MODE_ENABLED, Mode
from uam_control.settings import configuration, yaml_file
from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import ParameterError

SEPARATOR = " → "
MAPPED = ("thr_mdl_fac", "rate_p", "rate_k")  # of `RateThrustParameters`
KEYS = {"label", "autopilot", "integers_as_bytes", "modes", "loss_time", "recorded", *MAPPED}


class Firmware:
    """How one firmware speaks.

    `loss_time`: parameter with the time [s] without setpoints until its failsafe, "" for none;
    `mapped`: parameter → (field of `RateThrustParameters`, axis or None).
    """

    def __init__(self, folder: Path) -> None:
        """Read `firmware.yaml` in `folder`; raises ConfigurationError in one line."""
        self.folder = folder
        file = folder / "firmware.yaml"
        table = yaml_file.read(file, ConfigurationError)
        if not isinstance(table, dict) or not {"label", "autopilot", "modes"} <= set(table) <= KEYS:
            raise ConfigurationError(
                f"{file}: label, autopilot and modes are needed; allowed: {', '.join(sorted(KEYS))}"
            )
        self.label, self.autopilot = str(table["label"]), int(table["autopilot"])  # MAV_AUTOPILOT
        self.integers_as_bytes = bool(table.get("integers_as_bytes", False))  # of PARAM_VALUE
        self.loss_time = table.get("loss_time", "")
        self._modes = _modes(file, table["modes"])
        self._named = {number: mode for mode, number in self._modes.items()}
        self.mapped: dict[str, tuple[str, int | None]] = {}
        for field in MAPPED:
            names = table.get(field, [])
            for axis, name in enumerate(names):
                self.mapped[name] = field, axis if len(names) > 1 else None
        others = filter(None, (*table.get("recorded", ()), self.loss_time))
        self.watched = tuple(dict.fromkeys((*self.mapped, *others)))  # all that the bridge reads
        self.advice_by_pattern: dict[str, str] = self.table("advice")  # the first match counts
        self._passing = {
            when: re.compile("|".join(patterns), re.IGNORECASE)
            for when, patterns in self.table("passing").items()
        }

    def custom_mode(self, mode: Mode) -> int:
        """Return HEARTBEAT.custom_mode of a mode; 0 for one that this firmware lacks."""
        return self._modes.get(mode, 0)

    def mode(self, custom_mode: int) -> Mode:
        """Return the mode of a HEARTBEAT.custom_mode; UNKNOWN for others."""
        return self._named.get(custom_mode, Mode.UNKNOWN)

    def mode_request(self, mode: Mode) -> tuple[float, ...]:
        """Return the parameters of DO_SET_MODE for a mode."""
        number = self.custom_mode(mode)
        parts = (number >> 16 & 0xFF, number >> 24 & 0xFF) if number >> 16 else (number, 0)
        return CUSTOM_MODE_ENABLED, *parts

    def requested(self, main: int, sub: int) -> Mode:
        """Return the mode that a DO_SET_MODE names; UNKNOWN for others."""
        numbers = main << 16 | sub << 24, main
        return next((self.mode(one) for one in numbers if one in self._named), Mode.UNKNOWN)

    def file(self, name: str) -> Path:
        """Return the file `name`.yaml of this firmware; raises ConfigurationError without one."""
        found, place = self.folder / f"{name}.yaml", self.folder.name
        if not found.is_file():
            there = ", ".join(sorted(file.name for file in self.folder.glob("*.yaml")))
            raise ConfigurationError(f"no {place}/{name}.yaml; {place}/ has: {there}")
        return found

    def table(self, name: str) -> Any:
        """Return the content of the file `name`.yaml of this firmware, {} without one."""
        file = self.folder / f"{name}.yaml"
        return yaml_file.read(file, ConfigurationError) if file.is_file() else {}

    def passing(self, text: str, streaming: bool) -> bool:
        """Return whether `text` also comes in a normal start or landing (passing.yaml).

        streaming: whether setpoints have been streamed long enough.
        """
        asked = ("start_and_landing",) if streaming else ("start_and_landing", "before_the_stream")
        found = (self._passing.get(one) for one in asked)
        return any(pattern is not None and pattern.search(text) for pattern in found)

    def advice(self, text: str) -> str | None:
        """Return the advice for `text`; None if no pattern matches."""
        for pattern, what in self.advice_by_pattern.items():
            if re.search(pattern, text, re.IGNORECASE):
                return what
        return None

    def with_advice(self, text: str) -> str:
        """Return `text` followed by its advice; unchanged if it has advice already."""
        what = None if SEPARATOR in text else self.advice(text)
        return text if what is None else f"{text}{SEPARATOR}{what}"


def _modes(file: Path, given: Mapping[str, Any]) -> dict[Mode, int]:
    """Return mode → HEARTBEAT.custom_mode; raises ConfigurationError for a mode of another name."""
    found = {}
    for name, number in given.items():
        if name not in Mode.__members__ or name == Mode.UNKNOWN.name:
            allowed = ", ".join(Mode.__members__)
            raise ConfigurationError(f"{file}: modes: '{name}' is not one of {allowed}")
        whole = number if isinstance(number, int) else number[0] << 16 | number[1] << 24
        found[Mode[name]] = whole
    if Mode.OFFBOARD not in found:
        raise ConfigurationError(f"{file}: modes: OFFBOARD is missing: it takes the setpoints")
    return found


PX4 = "px4"
FIRMWARES = {name: Firmware(configuration.path(name)) for name in (PX4,)}


def firmware(name: str) -> Firmware:
    """Return the firmware `name`; raises ParameterError for an unknown name."""
    if name not in FIRMWARES:
        raise ParameterError(f"firmware: '{name}' is not one of {', '.join(FIRMWARES)}")
    return FIRMWARES[name]
