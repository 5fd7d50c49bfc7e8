"""The autopilot's parameters: PX4's names, units, ranges and v1.16 defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from uam_control.settings import configuration, yaml_file
from uam_control.settings.parameter_set import ParameterError
from uam_control.settings.texts import unknown
from uam_control.vehicle import VehicleDescription
from uam_control.vehicle.rotor_geometry import USUAL_COEFFICIENT


@dataclass(frozen=True)
class Definition:
    """Default, range and unit of one parameter; `integer`: sent as INT32 over MAVLink."""

    default: float
    low: float
    high: float
    unit: str
    description: str
    integer: bool = False


ROTORS_MAX = 12  # as PX4's control allocation
ROTOR = {  # what of a rotor → default, limit, unit, meaning
    "PX": (0.0, 5.0, "m", "forward"),
    "PY": (0.0, 5.0, "m", "right"),
    "KM": (0.05, 1.0, "m", "moment per thrust, > 0 counter-clockwise"),
    "CT": (USUAL_COEFFICIENT, 100.0, "N", "thrust at full speed, without effect here"),
}
ANY = 1e9  # limit of a parameter that is only stored


def _definitions() -> dict[str, Definition]:
    """Return the parameters by name: those in use, those of each rotor, those only stored."""
    used, *stored = (
        yaml_file.read(configuration.path(f"px4/{name}.yaml"), ParameterError)
        for name in ("stand_in_parameters", "stand_in", "sitl")
    )
    found = {name: Definition(*row, isinstance(row[0], int)) for name, row in used.items()}
    for i in range(ROTORS_MAX):
        for what, (default, limit, unit, text) in ROTOR.items():
            row = default, -limit, limit, unit, f"rotor {i + 1} {text}"
            found[f"CA_ROTOR{i}_{what}"] = Definition(*row)
    for name, value in (stored[0] | stored[1]).items():
        row = value, -ANY, ANY, "", "stored without effect", isinstance(value, int)
        found.setdefault(name, Definition(*row))
    return found


DEFINITIONS = _definitions()


class Parameters:
    """A complete set of values; the order of `names` is the index in PARAM_VALUE."""

    names = tuple(DEFINITIONS)

    def __init__(self, values: dict[str, float] | None = None) -> None:
        """Raises ParameterError on an unknown name or a value out of range."""
        self._values = {name: d.default for name, d in DEFINITIONS.items()}
        for name, value in (values or {}).items():
            self.set(name, value)

    @classmethod
    def of(cls, vehicle: VehicleDescription, file: Path | str | None = None) -> Parameters:
        """Return the parameters of a vehicle, overridden by a YAML file of lines `NAME: value`.

        Raises ParameterError in one line with the file's name, also if the rotor geometry (CA_*) of
        the file differs from the vehicle's.
        """
        derived = vehicle.autopilot_parameters()
        values = {} if file is None else yaml_file.read(Path(file), ParameterError)
        if not isinstance(values, dict):
            raise ParameterError(f"{file}: 'NAME: value' lines expected")
        for name in sorted(derived.keys() & values.keys()):
            if name.startswith("CA_") and values[name] != derived[name]:
                raise ParameterError(
                    f"{file}: {name}: {values[name]!r}, but {vehicle.file.name} makes it "
                    f"{derived[name]:g}"
                )
        try:
            return cls(derived | values)
        except ParameterError as error:
            where = file or f"{vehicle.file}: autopilot: {vehicle.autopilot}"
            raise ParameterError(f"{where}: {error}") from None

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def set(self, name: str, value: float) -> None:
        """Set one value; raises ParameterError with the allowed range, without a change."""
        definition = DEFINITIONS.get(name)
        if definition is None:
            raise ParameterError(f"autopilot parameter {name}: {unknown(name, DEFINITIONS)}")
        allowed = f"allowed: {definition.low:g} to {definition.high:g} {definition.unit}"
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ParameterError(f"{name}: {value!r} is not a number; {allowed}")
        if not math.isfinite(value) or not definition.low <= value <= definition.high:
            raise ParameterError(f"{name}: {value:g} is out of range; {allowed}")
        if definition.integer and value != int(value):
            raise ParameterError(f"{name}: {value:g} is not an integer; {allowed}")
        self._values[name] = float(value)

    def vector(self, *names: str) -> list[float]:
        return [self._values[name] for name in names]

    def rotors(self) -> tuple[list[float], list[float], list[float]]:
        """Return px, py, km, each of length CA_ROTOR_COUNT [m]: see `effectiveness`."""
        rotors = range(int(self["CA_ROTOR_COUNT"]))
        px, py, km = (
            self.vector(*(f"CA_ROTOR{i}_{what}" for i in rotors)) for what in ("PX", "PY", "KM")
        )
        return px, py, km
