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
from typing import NamedTuple

from uam_control.offboard.firmware import FIRMWARES, PX4, Firmware
from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.section import Section, read_section

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
        if self.found is None:
            return f"{self.name} was not answered, {self.required} required: {self.why}"
        return f"{self.name} is {self.found:.9g}, {self.required} required: {self.why}"


@dataclass(frozen=True)
class Rule:
    """What a parameter must be, and why."""

    why: str
    values: tuple[float, ...] = ()  # allowed ones; (): any
    least: float = -math.inf  # limit, itself allowed
    most: float = math.inf  # limit, itself allowed
    bits: int = 0  # all must be set
    optional: bool = False  # an autopilot without this parameter passes
    instead: str = ""  # one with that parameter passes, too

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
        top, rules = read_section(file, ConfigurationError), cls()
        for section in map(top.section, top.values):
            for name in section.values:
                if name in rules:
                    raise section.error(name, "is there twice")
                rules[name] = _rule(section, name)
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


def _rule(section: Section, name: str) -> Rule:
    """Return the rule `name` of a section of the file."""
    entry = section.section(name)
    entry.only((*_RULES, "why", "optional", "instead"))
    given = [key for key in _RULES if entry.has(key)]
    if len(given) != 1 and given != ["least", "most"]:
        text = f"{', '.join(given) or 'no rule'}; one of {', '.join(_RULES)} expected"
        raise section.error(name, f"{text}; only least and most go together")
    least, most = entry.number("least", default=-math.inf), entry.number("most", default=math.inf)
    if least > most:
        raise section.error(name, f"least {least:g} is above most {most:g}")
    return Rule(
        entry.text("why"),
        (entry.number("is"),) if "is" in given else entry.numbers("one_of", default=()),
        least,
        most,
        entry.whole("bits", 1, default=0),
        entry.switch("optional", default=False),
        entry.text("instead", default=""),
    )
