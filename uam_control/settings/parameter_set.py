"""Parameter sets: frozen dataclasses whose fields contain meaning, unit and range.

`validated` checks a set as a whole. The error of a refused set contains the name of the parameter,
its value and the allowed range. The ROS nodes declare their parameters from the same fields.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from numbers import Integral
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, TypeVar

import numpy as np

from uam_control.settings.texts import unknown

TINY = 1e-9
HUGE = 1e6
ANY_LENGTH = -1  # of a vector


class ParameterError(ValueError):
    """A parameter set that is not valid; the message has the parameter and the allowed range."""


class MissingParameter(ParameterError):
    """A parameter without a default that has no value."""


@dataclass(frozen=True)
class Bound:
    """Meaning, unit and range of a numeric parameter."""

    description: str
    unit: str
    low: float
    high: float
    length: int | None = None  # entries; 0: one per axis; ANY_LENGTH; None: one number
    whole: bool = False  # an integer
    optional: bool = False  # the list may be empty

    @property
    def allowed(self) -> str:
        """Return the range as text."""
        if self.whole:
            return f"{self.low:d} to {self.high:d}"
        return f"{self.low:g} to {self.high:g} {self.unit}".removesuffix(" 1")


@dataclass(frozen=True)
class Choice:
    """Meaning of a parameter that is one of several words; `fixed`: read-only in a running node."""

    description: str
    choices: Collection[str]
    fixed: bool = False


@dataclass(frozen=True)
class Switch:
    """Meaning of a parameter that is true or false."""

    description: str


@dataclass(frozen=True)
class Text:
    """Meaning of a parameter that is a text."""

    description: str
    allowed: str  # its form, for the user
    secret: bool = False  # it is never shown
    file: bool = False  # a path is allowed, too
    several: bool = False  # a list of texts, one text is a list of one


@dataclass(frozen=True)
class Entries:
    """Meaning of a parameter that is a mapping, which its user checks."""

    description: str


Spec = Bound | Choice | Switch | Text | Entries


def integer(default: int | None, description: str, low: int, high: int) -> Any:
    """Declare a field that is one integer within [low, high]."""
    spec = Bound(description, "", low, high, whole=True)
    return field(default=default, metadata={"spec": spec})


def number(default: float | None, description: str, unit: str, low: float, high: float) -> Any:
    """Declare a field that is one number within [low, high]."""
    return field(default=default, metadata={"spec": Bound(description, unit, low, high)})


def vector(
    default: tuple,
    description: str,
    unit: str,
    low: float,
    high: float,
    length: int = 0,
    optional: bool = False,
) -> Any:
    """Declare a field of `length` numbers, see `Bound`, each within [low, high].

    A per-axis default has one entry, used for every axis; () means that there is no default, or
    the empty list if the field is optional.
    """
    spec = Bound(description, unit, low, high, length, optional=optional)
    return field(default=default, metadata={"spec": spec})


def choice(
    default: str | None, description: str, choices: Collection[str], fixed: bool = False
) -> Any:
    """Declare a field that is one of `choices`; `fixed`: read-only in a running node."""
    return field(default=default, metadata={"spec": Choice(description, choices, fixed)})


def switch(default: bool, description: str) -> Any:
    """Declare a field that is true or false."""
    return field(default=default, metadata={"spec": Switch(description)})


def text(
    default: str | None, description: str, allowed: str, secret: bool = False, file: bool = False
) -> Any:
    """Declare a field that is a text; see `Text`."""
    return field(default=default, metadata={"spec": Text(description, allowed, secret, file)})


def texts(description: str, allowed: str, file: bool = False) -> Any:
    """Declare a field that is a list of texts, see `Text`, by default an empty one."""
    spec = Text(description, allowed, file=file, several=True)
    return field(default=(), metadata={"spec": spec})


def entries(description: str) -> Any:
    """Declare a field that is a mapping, by default an empty one."""
    return field(default_factory=dict, metadata={"spec": Entries(description)})


@dataclass(frozen=True)
class ParameterSet:
    """Base of every parameter set. A field whose default is None may be None: not given."""

    @classmethod
    def specs(cls) -> dict[str, Spec]:
        """Return name → meaning, unit and range of each parameter, in order."""
        return {item.name: item.metadata["spec"] for item in fields(cls)}

    @classmethod
    def from_mapping(cls, values: dict[str, Any], axes: int = 0) -> Self:
        """Return a validated set; raise ParameterError for unknown names or invalid values."""
        known = cls.specs()
        for name in values:
            if name not in known:
                raise ParameterError(f"{name}: {unknown(name, known)}")
        return cls(**values).validated(axes)

    def to_mapping(self) -> dict[str, Any]:
        """Return the set as a mapping for YAML and `from_mapping`, without empty lists."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
            if value != ()
        }

    @classmethod
    def among(cls, values: Mapping[str, Any], axes: int = 0) -> Self:
        """Return the set of those `values` that belong to it, `validated` for `axes`."""
        return cls.from_mapping({k: v for k, v in values.items() if k in cls.specs()}, axes)

    def validated(self, axes: int = 0) -> Self:
        """Return this set with floats and tuples of floats; raise ParameterError if one is invalid.

        axes: number of entries of a per-axis vector. A parameter without a default that has no
        value raises MissingParameter.
        """
        clean = {}
        for name, spec in self.specs().items():
            value = getattr(self, name)
            if value is None and getattr(type(self), name, ...) is None:
                continue
            if isinstance(spec, Bound):
                if spec.length == 0 and value is getattr(type(self), name):
                    value = axes * value  # the default, repeated for every axis
                if isinstance(value, tuple) and not value:
                    _check_not_required(name, spec, axes)
                clean[name] = _number(name, value, spec, axes)
            elif isinstance(spec, Choice) and value not in tuple(spec.choices):
                raise ParameterError(f"{name}: '{value}' is not one of {', '.join(spec.choices)}")
            elif isinstance(spec, Switch) and not isinstance(value, bool):
                raise ParameterError(f"{name}: {value!r} is not true or false")
            elif isinstance(spec, Text):
                clean[name] = _text(name, value, spec)
            elif isinstance(spec, Entries) and not isinstance(value, Mapping):
                raise ParameterError(f"{name}: name → value expected, got {value!r}")
        checked = replace(self, **clean)
        checked.check_together()
        return checked

    def check_together(self) -> None:
        """Raise ParameterError if valid values contradict each other."""


def _check_not_required(name: str, spec: Bound, axes: int) -> None:
    """Raise MissingParameter for a list that must not be empty."""
    count = spec.length or axes
    if count and count != ANY_LENGTH and not spec.optional:
        raise MissingParameter(f"{name} is missing: {count} numbers, each {spec.allowed}")


def _text(name: str, value: Any, spec: Text) -> Any:
    """Return a text; where several are allowed, a tuple of them."""
    several = spec.several and isinstance(value, Iterable) and not isinstance(value, str)
    found = tuple(value) if several else (value,)
    for one in found:
        if not isinstance(one, str | Path if spec.file else str):
            what = "the value" if spec.secret else repr(one)
            raise ParameterError(f"{name}: {what} is no text; allowed: {spec.allowed}")
    return found if spec.several else value


def _number(name: str, value: Any, spec: Bound, axes: int) -> float | tuple[float, ...]:
    allowed = spec.allowed
    if spec.whole:
        if isinstance(value, bool) or not isinstance(value, Integral):
            raise ParameterError(f"{name}: {value!r} is no integer; allowed: {allowed}")
        if not spec.low <= value <= spec.high:
            raise ParameterError(f"{name}: {value} is outside {allowed}")
        return int(value)
    if spec.optional and not np.size(value):
        return ()
    try:
        numbers = np.asarray(value)
    except ValueError:  # lists of different lengths
        numbers = np.array(None)
    shown = value.tolist() if hasattr(value, "tolist") else value  # ROS gives an array
    if numbers.dtype.kind not in "iuf":  # refuses true and "1" too
        raise ParameterError(f"{name}: {shown!r} is not numeric; allowed: {allowed}")
    numbers = numbers.astype(float)
    shape = () if spec.length is None else (spec.length or axes,)
    if spec.length == ANY_LENGTH and numbers.ndim == 1:
        shape = numbers.shape
    if numbers.shape != shape:
        required = "one number" if spec.length is None else f"a list of {shape[0]} numbers"
        required = "a list of numbers" if spec.length == ANY_LENGTH else required
        raise ParameterError(f"{name}: {required} expected, got {shown!r}; each {allowed}")
    if not np.all((numbers >= spec.low) & (numbers <= spec.high)):  # refuses NaN too
        raise ParameterError(f"{name}: {shown!r} is outside {allowed}")
    return float(numbers) if spec.length is None else tuple(numbers.tolist())


class NamedSet(ParameterSet):
    """Base of sets with a name. A subclass is a frozen dataclass without a decorator.

    NAME: that of the class, `MotorLoss` is `motor_loss`; ABOUT: its docstring in one line, as the
    description for the user.
    """

    NAME: ClassVar[str]
    ABOUT: ClassVar[str]

    def __init_subclass__(cls) -> None:
        cls.NAME = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()
        about = " ".join((cls.__doc__ or "").split()).rstrip(".")
        cls.ABOUT = about[:1].lower() + about[1:]
        dataclass(frozen=True)(cls)


class HasKind(Protocol):
    """A class with the class of its parameters."""

    kind: ClassVar[Any]


Named = TypeVar("Named", bound=HasKind)


def by_name(parameter: str, classes: Iterable[type[Named]]) -> dict[str, type[Named]]:
    """Return the classes by the default that `parameter` has in their `kind`.

    Raises ParameterError for a name of two: one of them would not fly.
    """
    found: dict[str, type[Named]] = {}
    for one in classes:
        name = getattr(one.kind, parameter)
        if (other := found.setdefault(name, one)) is not one:
            both = " and ".join(f"{c.__module__}.{c.__name__}" for c in (other, one))
            raise ParameterError(f"{parameter}: '{name}' is the name of {both}")
    return found
