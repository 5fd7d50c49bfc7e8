"""Checked access to the entries of a YAML file; each error names file and entry in one line."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from functools import wraps
from pathlib import Path
from typing import Any

from uam_control.settings import yaml_file
from uam_control.settings.texts import unknown, visible


def read_section(file: Path, error: type[ValueError]) -> Section:
    """Return the content of a YAML file, a mapping; raise `error` if it is none."""
    values = yaml_file.read(file, error)
    if not isinstance(values, dict):
        raise error(f"{file}: a mapping expected: 'name: value' lines")
    return Section(values, f"{file}:", error)


MISSING = object()


def _reader(read: Callable[..., Any]) -> Callable[..., Any]:
    """Let a method that reads an entry return `default`, if one is given, for an entry left out."""

    @wraps(read)
    def reader(section: Section, key: str, *how: Any, default: Any = MISSING) -> Any:
        left_out = default is not MISSING and not section.has(key)
        return default if left_out else read(section, key, *how)

    return reader


class Section:
    """A mapping of a file; its methods check one entry and raise `error` with its place.

    Those for one value have an argument `default`, for an entry that may be left out.
    """

    def __init__(self, values: dict[str, Any], where: str, error: type[ValueError]) -> None:
        self.values, self.where, self._error = values, where, error
        self._asked: dict[str, None] = {}
        self._inner: dict[str, Section] = {}

    def like(self, values: dict[str, Any]) -> Section:
        """Return a section with other values, and errors of the same place."""
        return Section(values, self.where, self._error)

    def error(self, key: str, text: str) -> ValueError:
        """Return the error that the entry `key` is wrong; text: what is wrong, what is allowed."""
        return self._error(f"{self._name(key)}: {text}")

    def only(self, allowed: Collection[str]) -> None:
        """Refuse an entry whose key is not in `allowed`."""
        self._asked |= dict.fromkeys(allowed)
        for key in self.values:
            if key not in allowed:
                raise self.error(key, unknown(key, allowed))

    def only_asked(self) -> None:
        """Refuse an entry, here or in a section within, that no method has been asked for."""
        self.only(self._asked)
        for section in self._inner.values():
            section.only_asked()

    def has(self, key: str) -> bool:
        """Return whether the file gives the entry `key`, which may be left out."""
        self._asked[key] = None
        return key in self.values

    def entry(self, key: str) -> Any:
        """Return the entry `key` as it is in the file."""
        self._asked[key] = None
        if key not in self.values:
            raise self._error(f"{self._name(key)} is missing")
        return self.values[key]

    def section(self, key: str) -> Section:
        """Return the entry `key`, a mapping."""
        return self._within(key, self.mapping(key))

    def mapping(self, key: str) -> dict[str, Any]:
        """Return the entry `key`, a mapping whose keys its reader checks."""
        value = self.entry(key)
        if value == {}:
            raise self.error(key, "has no entry: give one, or leave it out")
        if not isinstance(value, dict):
            raise self.error(key, f"a mapping expected, got {value!r}")
        return value

    def entries(self, key: str, optional: bool = False) -> list[Section]:
        """Return the entry `key`, a list of one mapping or more; optional: [] if it is missing."""
        if optional and not self.values.get(key):
            return []
        value = self.entry(key)
        if not isinstance(value, list) or not value:
            raise self.error(key, f"a list of mappings expected, got {value!r}")
        found = []
        for i, entry in enumerate(value):
            if not isinstance(entry, dict):
                raise self._error(f"{self._name(key)}[{i}]: a mapping expected, got {entry!r}")
            found.append(self._within(f"{key}[{i}]", entry))
        return found

    def _within(self, key: str, values: dict[str, Any]) -> Section:
        return self._inner.setdefault(key, Section(values, self._name(key), self._error))

    @_reader
    def text(self, key: str) -> str:
        """Return the entry `key`, a text that is not empty."""
        value = self.entry(key)
        if not isinstance(value, str) or not value:
            raise self.error(key, f"a name expected, got {value!r}")
        return value

    @_reader
    def one_of(self, key: str, allowed: Collection[str]) -> str:
        """Return the entry `key`, one of the texts `allowed`."""
        value = self.entry(key)
        if not isinstance(value, str) or value not in allowed:
            raise self.error(key, f"{value!r} is not one of {', '.join(allowed)}")
        return value

    @_reader
    def texts(self, key: str) -> tuple[str, ...]:
        """Return the entry `key`, a list of one text or more."""
        value = self.entry(key)
        if not isinstance(value, list) or not value or not all(isinstance(v, str) for v in value):
            raise self.error(key, f"a list of names expected, got {value!r}")
        return tuple(value)

    @_reader
    def switch(self, key: str) -> bool:
        """Return the entry `key`, true or false."""
        value = self.entry(key)
        if not isinstance(value, bool):
            raise self.error(key, f"true or false expected, got {value!r}")
        return value

    @_reader
    def number(self, key: str) -> float:
        """Return the entry `key`, a finite number."""
        return self._checked(key, self.entry(key))

    @_reader
    def positive(self, key: str) -> float:
        """Return the entry `key`, a finite number above 0."""
        value = self.number(key)
        if value <= 0.0:
            raise self.error(key, f"{value:g} is not above 0")
        return value

    def not_negative(self, key: str) -> float:
        """Return the entry `key`, a finite number of 0 or more."""
        value = self.number(key)
        if value < 0.0:
            raise self.error(key, f"{value:g} is below 0")
        return value

    @_reader
    def whole(self, key: str, low: int = 0, high: float = math.inf) -> int:
        """Return the entry `key`, a whole number from `low` to `high`."""
        value = self.entry(key)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            allowed = f"{low} to {high}" if math.isfinite(high) else f"{low}, {low + 1}, .."
            raise self.error(key, f"a whole number expected, {allowed}, got {value!r}")
        return value

    @_reader
    def numbers(self, key: str, count: int | None = None) -> tuple[float, ...]:
        """Return the entry `key`, a list of `count` finite numbers; None: of one or more."""
        return self._listed(key, self.entry(key), count)

    def rows(self, key: str, count: int) -> tuple[tuple[float, ...], ...]:
        """Return the entry `key`, a list of lists of `count` finite numbers each."""
        value = self.entry(key)
        if not isinstance(value, list) or not value:
            raise self.error(key, f"a list of lists of numbers expected: {value!r}")
        return tuple(self._listed(f"{key}[{i}]", row, count) for i, row in enumerate(value))

    def _listed(self, key: str, value: Any, count: int | None) -> tuple[float, ...]:
        length = len(value) if isinstance(value, list) else -1
        if length < 1 if count is None else length != count:
            numbers = "numbers" if count is None else f"{count} numbers"
            raise self.error(key, f"a list of {numbers} expected: {value!r}")
        return tuple(self._checked(key, item) for item in value)

    def _checked(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"a number expected, got {value!r}")
        if not math.isfinite(value):
            raise self.error(key, f"{value!r} is not finite")
        return float(value)

    def _name(self, key: str) -> str:
        return f"{self.where}{' ' if self.where.endswith(':') else '.'}{visible(key)}"
