"""What a description cannot hold: taken from answers, asked at the terminal, or assumed."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section
from uam_control.settings.texts import unknown
from uam_lab.importing.source import ImportRefused

FILE, DERIVED, ASKED, ASSUMED = "from the file", "derived", "asked", "assumed"


@dataclass
class Told:
    """A value and where it comes from: FILE, DERIVED, ASKED or ASSUMED, and why."""

    value: Any
    origin: str
    reason: str = ""

    def __str__(self) -> str:
        """Return the origin as a comment."""
        return f"{self.origin}: {self.reason}" if self.reason else self.origin


@dataclass
class Answers:
    """Answers by key; `ask` puts a question to the user, None: nobody is there to be asked."""

    given: dict[str, Any] = field(default_factory=dict)
    ask: Callable[[str, str, Any], str] | None = None
    assumed: Section = field(
        default_factory=lambda: read_section(
            configuration.path("import/assumed.yaml"), ImportRefused
        )
    )

    def __post_init__(self) -> None:
        """Refuse an answer to a question that is never put."""
        self._questions = self.assumed.mapping("questions")
        for key in self.given:
            if key not in self._questions:
                raise ImportRefused(f"answers: {key}: {unknown(key, self._questions)}")
        self.unused = set(self.given)  # of what has not been needed so far

    def number(
        self,
        key: str,
        usual: float,
        why: str,
        high: float = math.inf,
        known: Told | None = None,
    ) -> Told:
        """Return a positive number of at most `high`.

        usual: what is assumed, why; known: by the file, asked only if the user has answered.
        """
        if known is not None and key not in self.given:
            return known
        usual = float(f"{usual:.4g}")
        given = self._answer(key, usual)
        if given is None:
            return Told(usual, ASSUMED, why)
        try:
            value = float(given)
        except (TypeError, ValueError):
            value = math.nan
        if isinstance(given, bool) or not 0.0 < value <= high or math.isinf(value):
            most = "" if math.isinf(high) else f", at most {high:g}"
            raise ImportRefused(f"answers: {key}: {given!r}: a number above 0{most} expected")
        return Told(value, ASKED)

    def name(self, key: str, usual: str, why: str, allowed: Mapping[str, Any]) -> Told:
        """Return one of the names `allowed`."""
        given = self._answer(key, usual)
        if given is None:
            return Told(usual, ASSUMED, why)
        if given not in allowed:
            raise ImportRefused(f"answers: {key}: {unknown(str(given), allowed)}")
        return Told(given, ASKED)

    def each(self, key: str, usual: str, why: str, allowed: Mapping[str, Any], count: int) -> Told:
        """Return `count` of the names `allowed`; an answer is one for all, or all with commas."""
        given = self._answer(key, usual)
        if given is None:
            return Told([usual] * count, ASSUMED, why)
        names = str(given).split(",")
        for name in names:
            if name not in allowed:
                raise ImportRefused(f"answers: {key}: {unknown(name, allowed)}")
        if len(names) not in (1, count):
            raise ImportRefused(f"answers: {key}: {given}: one for all, or {count} with commas")
        return Told(names * (count // len(names)), ASKED)

    def _answer(self, key: str, usual: Any) -> Any:
        self.unused.discard(key)
        if key in self.given or self.ask is None:
            return self.given.get(key)
        what, unit = self._questions[key]
        return self.ask(what, unit, usual) or None


def read_answers(file: Path | None, words: list[str]) -> dict[str, Any]:
    """Return answers by key: of a YAML file, with sections or dotted keys, and of KEY=VALUE."""
    found: dict[str, Any] = {}
    if file is not None:
        for key, value in read_section(file, ImportRefused).values.items():
            inner = value.items() if isinstance(value, dict) else [("", value)]
            found |= {f"{key}.{name}".rstrip("."): entry for name, entry in inner}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals:
            raise ImportRefused(f"--set {word}: KEY=VALUE expected")
        found[key] = value
    return found
