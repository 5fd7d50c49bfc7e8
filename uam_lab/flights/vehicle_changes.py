"""Changes of a vehicle's numbers for one flight, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import deepcopy
from numbers import Real
from typing import Any

from uam_control.settings.section import Section
from uam_control.vehicle.plant_numbers import NOT_OF_THE_PLANT, check_plant_numbers
from uam_control.vehicle.servo_types import apart
from uam_lab.flights.node_options import SettingsError
from uam_lab.records.results.metrics import plain

EFFECTS = "effects"  # of the plant, beside the numbers of a vehicle
WHERE = "vehicle_changes:"


def checked(given: Mapping[str, Any], numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the changes of a vehicle's numbers, dotted name → value, in lists and plain numbers.

    numbers: those of its description, which the changes must fit: names, types, lengths of lists,
    and what the plant requires of them. Raises SettingsError.
    """
    changed, found = deepcopy(dict(numbers)), {}
    for name, value in given.items():
        found[name] = value if name == EFFECTS else plain(value)
        if name != EFFECTS:
            entry, last = _place(name, changed)
            _check_read(str(name), changed)
            _check_alike(name, value, entry[last])
            entry[last] = found[name]
    if found.keys() - {EFFECTS}:
        where = f"{WHERE} servos"
        servos = apart(changed["servos"], len(changed["joints"]), where, SettingsError)
        check_plant_numbers(Section(changed, WHERE, SettingsError), servos)
    return found


def _place(name: Any, numbers: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """Return the mapping that has the entry `name`, and its key there. Raises SettingsError."""
    entry: Any = numbers
    keys = str(name).split(".")
    for depth, key in enumerate(keys):
        if not isinstance(entry, dict) or key not in entry:
            above = ".".join(keys[:depth]) or "the vehicle"
            allowed = ", ".join(entry) if isinstance(entry, dict) else "nothing, it is a value"
            raise SettingsError(f"{WHERE} unknown entry '{name}'; {above} has: {allowed}")
        if depth < len(keys) - 1:
            entry = entry[key]
    return entry, keys[-1]


def _check_read(name: str, numbers: dict[str, Any]) -> None:
    """Raise SettingsError for an entry that the plant does not read."""
    if any(f"{name}.".startswith(f"{entry}.") for entry in NOT_OF_THE_PLANT):
        top, dot, _ = name.partition(".")
        beside = [f"{top}.{key}" for key in numbers[top]] if dot else list(numbers)
        read = ", ".join(one for one in beside if one not in NOT_OF_THE_PLANT)
        raise SettingsError(
            f"{WHERE} {name}: the plant does not read it, give a vehicle file; it reads {read}"
        )


def _check_alike(name: str, value: Any, before: Any) -> None:
    """Raise SettingsError if a value is of another type or length than the one it replaces."""
    expected = ""
    if _is_number(before):
        expected = "" if _is_number(value) else "a number"
    elif isinstance(before, str):
        expected = "" if isinstance(value, str) else "a text"
    elif before and isinstance(before, list) and all(map(_is_number, before)):
        values = plain(value)
        fits = isinstance(values, list) and len(values) == len(before)
        expected = (
            "" if fits and all(map(_is_number, values)) else f"a list of {len(before)} numbers"
        )
    elif isinstance(before, dict):
        expected = f"one of its entries, {', '.join(before)},"
    if expected:
        raise SettingsError(f"{WHERE} {name}: {expected} expected, got {value!r}")


def _is_number(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, Real) and math.isfinite(value)
