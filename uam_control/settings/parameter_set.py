"""Parameter sets as frozen dataclasses whose fields say meaning, unit and range.

A set is checked as a whole by `validated`: what passes may fly, what does not is refused with the
name of the value, what was wrong and what is allowed. The ROS nodes declare their parameters from
the same fields.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Self

import numpy as np

TINY = 1e-9
HUGE = 1e6


class ParameterError(ValueError):
    """A parameter set that must not be used; the message says which value and what is allowed."""


@dataclass(frozen=True)
class Bound:
    """Meaning and range of a parameter; `length` None for one number, else how many numbers.

    A length of 0 means one number per axis of the subsystem.
    """

    description: str
    unit: str
    low: float
    high: float
    length: int | None = None


@dataclass(frozen=True)
class Choice:
    """Meaning of a parameter that is one of several words; `fixed` once its node runs."""

    description: str
    choices: tuple[str, ...]
    fixed: bool = False


@dataclass(frozen=True)
class Switch:
    """Meaning of a parameter that is true or false."""

    description: str


def number(default: float, description: str, unit: str, low: float, high: float) -> Any:
    """Declare a field that is one number within [low, high]."""
    return field(default=default, metadata={"spec": Bound(description, unit, low, high)})


def vector(
    default: tuple, description: str, unit: str, low: float, high: float, length: int = 0
) -> Any:
    """Declare a field of `length` numbers (0: one per axis), each within [low, high].

    A default of one number per axis has one entry, which every axis gets; () is no default.
    """
    spec = Bound(description, unit, low, high, length)
    return field(default=default, metadata={"spec": spec})


def choice(default: str, description: str, choices: tuple[str, ...], fixed: bool = False) -> Any:
    """Declare a field that is one of `choices`; `fixed` once the node runs."""
    return field(default=default, metadata={"spec": Choice(description, choices, fixed)})


def switch(default: bool, description: str) -> Any:
    """Declare a field that is true or false."""
    return field(default=default, metadata={"spec": Switch(description)})


@dataclass(frozen=True)
class ParameterSet:
    """Base of every parameter set."""

    @classmethod
    def specs(cls) -> dict[str, Bound | Choice | Switch]:
        """Return what each parameter means, in order."""
        return {item.name: item.metadata["spec"] for item in fields(cls)}

    @classmethod
    def from_mapping(cls, values: dict[str, Any], axes: int = 0) -> Self:
        """Return a validated set; raise ParameterError on unknown names or bad values."""
        known = cls.specs()
        for name in values:
            if name not in known:
                raise ParameterError(f"{name}: unknown; allowed: {', '.join(known)}")
        return cls(**values).validated(axes)

    def to_mapping(self) -> dict[str, Any]:
        """Return what `from_mapping` reads, as YAML has it; empty lists stand for defaults and stay
        out."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
            if value != ()
        }

    @classmethod
    def among(cls, values: Mapping[str, Any]) -> Self:
        """Return a validated set of those `values` that belong to it; others may be there."""
        return cls.from_mapping({k: v for k, v in values.items() if k in cls.specs()})

    def validated(self, axes: int = 0) -> Self:
        """Return this set with clean floats and tuples; raise ParameterError on the first fault.

        axes: how many numbers a per-axis vector has.
        """
        clean = {}
        for name, spec in self.specs().items():
            value = getattr(self, name)
            if isinstance(spec, Bound):
                if spec.length == 0 and value is getattr(type(self), name):
                    value = axes * value  # the default, the same for every axis
                clean[name] = _number(name, value, spec, axes)
            elif isinstance(spec, Choice) and value not in spec.choices:
                raise ParameterError(f"{name}: '{value}' is not one of {', '.join(spec.choices)}")
            elif isinstance(spec, Switch) and not isinstance(value, bool):
                raise ParameterError(f"{name}: {value!r} is not true or false")
        checked = replace(self, **clean)
        checked.check_together()
        return checked

    def check_together(self) -> None:
        """Raise ParameterError where values that are good by themselves do not go together."""


def _number(name: str, value: Any, spec: Bound, axes: int) -> float | tuple[float, ...]:
    allowed = f"{spec.low:g} to {spec.high:g} {spec.unit}"
    try:
        numbers = np.asarray(value)
    except ValueError:  # lists of different lengths
        numbers = np.array(None)
    if numbers.dtype.kind not in "iuf":  # neither true nor "1" is a number
        raise ParameterError(f"{name}: {value!r} is not numeric; allowed: {allowed}")
    numbers = numbers.astype(float)
    shape = () if spec.length is None else (spec.length or axes,)
    if numbers.shape != shape:
        required = "one number" if spec.length is None else f"a list of {shape[0]} numbers"
        raise ParameterError(f"{name}: {required} expected, got {value!r}; each {allowed}")
    if not np.all((numbers >= spec.low) & (numbers <= spec.high)):  # refuses NaN too
        raise ParameterError(f"{name}: {value!r} is outside {allowed}")
    return float(numbers) if spec.length is None else tuple(numbers.tolist())
