"""Values that the autopilot's parameters must have: rules from a file, and the differences.

config/px4/vehicle.yaml: sections of `NAME: {rule, why}`. The rules: is, one_of, least, most, bits;
`optional: true` beside a rule: an autopilot without this parameter passes. `instead: OTHER`: so
does one with the other parameter, as versions of PX4 that renamed it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from uam_control.offboard.firmware import FIRMWARES, PX4, Firmware
from uam_control.settings import yaml_file
from uam_control.settings.configuration import ConfigurationError

VEHICLE = "vehicle"  # name of the list for a real vehicle
_TOLERANCE = 1e-4  # relative: MAVLink carries 32-bit numbers
_RULES = ("is", "one_of", "least", "most", "bits")


class Difference(NamedTuple):
    """A parameter with another value than required; found: None if it was not answered."""

    name: str
    found: float | None
    required: str
    why: str

    @property
    def text(self) -> str:
        """Return the difference in one line."""
        if self.found is None:
            return f"{self.name} was not answered, {self.required} required: {self.why}"
        return f"{self.name} is {self.found:.9g}, {self.required} required: {self.why}"


@dataclass(frozen=True)
class Rule:
    """What a parameter must be, and why.

    values: allowed ones, () for any; least, most: limits, both allowed; bits: all must be set;
    optional: an autopilot without this parameter passes; instead: so does one with that parameter.
    """

    why: str
    values: tuple[float, ...] = ()
    least: float = -math.inf
    most: float = math.inf
    bits: int = 0
    optional: bool = False
    instead: str = ""

    def met(self, value: float) -> bool:
        """Return whether the value meets the rule, to the accuracy of 32-bit numbers."""
        if not math.isfinite(value):
            return False
        if self.values:
            return any(same(value, allowed) for allowed in self.values)
        if self.bits:
            return int(value) & self.bits == self.bits
        return self.least <= value <= self.most or same(value, self.least, self.most)

    @property
    def required(self) -> str:
        """Return the rule in words, as "0.5 to 1"."""
        if self.values:
            return " or ".join(f"{value:.9g}" for value in self.values)
        if self.bits:
            return f"bits {self.bits}"
        if math.isinf(self.most):
            return f"at least {self.least:g}"
        if math.isinf(self.least):
            return f"at most {self.most:g}"
        return f"{self.least:g} to {self.most:g}"


def same(value: float, *others: float) -> bool:
    """Return whether a parameter's value equals one of `others`, as MAVLink carries them."""
    return any(
        math.isclose(value, other, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE)
        for other in others
        if math.isfinite(other)
    )


class RequiredParameters(dict[str, Rule]):
    """Rules by the name of the parameter."""

    @classmethod
    def read(cls, given: str, spoken: Firmware = FIRMWARES[PX4]) -> RequiredParameters:
        """Return the rules of the firmware's file `given`.yaml, or of the file `given`.

        Raises ConfigurationError in one line: file, parameter, what is allowed.
        """
        file = Path(given) if Path(given).suffix else spoken.file(given)
        sections = yaml_file.read(file, ConfigurationError)
        if not isinstance(sections, dict):
            raise ConfigurationError(f"{file}: sections of 'NAME: {{rule, why}}' lines expected")
        rules = cls()
        for section, entries in sections.items():
            if not isinstance(entries, dict):
                raise ConfigurationError(f"{file}: {section}: 'NAME: {{rule, why}}' lines expected")
            for name, entry in entries.items():
                if name in rules:
                    raise ConfigurationError(f"{file}: {name} is there twice")
                try:
                    rules[name] = _rule(entry)
                except ValueError as error:
                    raise ConfigurationError(f"{file}: {name}: {error}") from None
        return rules

    def differences(
        self, values: Mapping[str, float], unanswered: bool = True
    ) -> tuple[Difference, ...]:
        """Return the differences of `values`, in the order of the rules.

        unanswered: parameters that `values` lacks count too.
        """
        return tuple(
            Difference(name, values.get(name), rule.required, rule.why)
            for name, rule in self.items()
            if (
                not rule.met(values[name])
                if name in values
                else unanswered and not rule.optional and rule.instead not in values
            )
        )

    @property
    def instead(self) -> dict[str, str]:
        """Return name → parameter that other versions have in its place."""
        return {name: rule.instead for name, rule in self.items() if rule.instead}


def _rule(entry: Any) -> Rule:
    """Return the rule of an entry of the file; raises ValueError."""
    if not isinstance(entry, dict) or not isinstance(entry.get("why"), str):
        raise ValueError("{rule, why: text} expected")
    beside = "why", "optional", "instead"
    given = {key: value for key, value in entry.items() if key not in beside}
    instead = entry.get("instead", "")
    if not isinstance(instead, str):
        raise ValueError(f"instead: {instead!r}; the name of a parameter is allowed")
    optional = entry.get("optional", False)
    if not isinstance(optional, bool):
        raise ValueError(f"optional: {optional!r}; true and false are allowed")
    allowed = f"rules are {', '.join(_RULES)}"
    if not given or not given.keys() <= set(_RULES):
        raise ValueError(f"{', '.join(map(str, given)) or 'no rule'}; {allowed}")
    if len(given) > 1 and given.keys() != {"least", "most"}:
        raise ValueError(f"{', '.join(given)}: only least and most go together")
    listed = given.get("one_of", [entry["is"]] if "is" in entry else [])
    if not isinstance(listed, list) or ("one_of" in given and not listed):
        raise ValueError("one_of: a list of numbers expected")
    for value in (*listed, *(given[key] for key in ("least", "most", "bits") if key in given)):
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise ValueError(f"{value!r} is not a number")
    bits = given.get("bits", 0)
    if "bits" in given and (not isinstance(bits, int) or bits < 1):
        raise ValueError(f"bits: {bits!r}; an integer from 1 on is allowed")
    rule = Rule(
        entry["why"],
        tuple(float(value) for value in listed),
        given.get("least", -math.inf),
        given.get("most", math.inf),
        bits,
        optional,
        instead,
    )
    if rule.least > rule.most:
        raise ValueError(f"least {rule.least:g} is above most {rule.most:g}")
    return rule
