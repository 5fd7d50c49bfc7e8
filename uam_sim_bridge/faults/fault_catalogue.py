"""All faults by name, their creation from parameters, and their list for the terminal."""

from types import ModuleType

from uam_control.settings.parameter_set import Bound, Choice, ParameterError
from uam_sim_bridge.faults import (
    actuator_faults,
    cable_faults,
    imu_faults,
    link_faults,
    mocap_faults,
    process_faults,
)
from uam_sim_bridge.faults.fault import Fault, FaultError

KINDS = (
    *(mocap_faults, imu_faults, actuator_faults, link_faults, process_faults),
    cable_faults,
)


def _faults(module: ModuleType) -> list[type[Fault]]:
    """Return the faults of a module: its classes on which no other is based, in order."""
    found = [one for one in vars(module).values() if isinstance(one, type)]
    own = [one for one in found if issubclass(one, Fault) and one.__module__ == module.__name__]
    return [kind for kind in own if not kind.__subclasses__()]


FAULTS: dict[str, type[Fault]] = {kind.NAME: kind for one in KINDS for kind in _faults(one)}


def make(name: object, values: dict[str, object]) -> Fault:
    """Return the fault `name` with the parameters `values`; raises FaultError in one line."""
    if not isinstance(name, str) or name not in FAULTS:
        raise FaultError(f"unknown fault {name!r}; there are: {', '.join(FAULTS)}")
    for parameter, spec in FAULTS[name].specs().items():
        value = values.get(parameter)
        if isinstance(value, float) and value.is_integer() and getattr(spec, "whole", False):
            values = values | {parameter: int(value)}  # 2.0 is a whole number, too
    try:
        return FAULTS[name].from_mapping(values)
    except ParameterError as error:
        raise FaultError(f"{name}: {error}") from None


def listing() -> str:
    """Return the catalogue as text for a terminal."""
    lines = []
    for name, kind in FAULTS.items():
        lines.append(f"{name:<20}{kind.ABOUT} [{kind.PLACE}]")
        lines += [f"{'':<20}  {word.replace('`', '')}" for word in parameters(kind)]
    return "\n".join(lines)


def parameters(kind: type[Fault]) -> list[str]:
    """Return one text per parameter of `kind`: description, range or choices, default."""
    words, usual = [], kind()
    for name, spec in kind.specs().items():
        default = getattr(usual, name)
        if isinstance(spec, Bound):
            unit = "" if spec.unit in ("", "1") else f" {spec.unit}"
            span = f"{spec.low:.4g} to {spec.high:.4g}{unit}: {default:.4g}"
            words.append(f"`{name}`: {spec.description} ({span})")
        elif isinstance(spec, Choice):
            chosen = ", ".join(spec.choices)
            words.append(f"`{name}`: {spec.description} ({chosen}: {default})")
    return words
