"""Differences of the autopilot's parameters from the required ones, in a diagnostic status.

The bridge adds this status to /uam/autopilot/state where parameters are required. Keys: `read` and
`required` (numbers of parameters), then one per difference: the parameter's name, with the value as
JSON {"found": number or null, "required": text, "why": text}.
"""

import json
from dataclasses import dataclass
from typing import Self

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from uam_control.settings.json_text import read_json
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.status import ERROR, OK, STALE, status_of, texts_of


@dataclass(frozen=True)
class ParameterDifference:
    """found: value on the autopilot, None if it does not answer; required, why: texts."""

    name: str
    found: float | None
    required: str
    why: str


@dataclass(frozen=True)
class ParameterComparison:
    """Result of the comparison."""

    read: int  # number of parameters
    required: int  # number of parameters
    complete: bool  # nothing is waited for any more
    differences: tuple[ParameterDifference, ...] = ()  # those found so far

    NAME = "autopilot parameters"

    @property
    def passed(self) -> bool:
        """Return whether every required parameter has been read and has a required value."""
        return self.complete and not self.differences

    @property
    def level(self) -> bytes:
        """Return ERROR with differences, STALE while parameters are missing, else OK."""
        if self.differences:
            return ERROR
        return OK if self.complete else STALE

    @property
    def summary(self) -> str:
        """Return the result in one line."""
        count = f"{self.read} of {self.required} parameters read"
        names = ", ".join(difference.name for difference in self.differences)
        return f"{count}; not as required: {names}" if names else count

    def to_status(self) -> DiagnosticStatus:
        """Return the status."""
        counts = {"read": self.read, "required": self.required, "complete": self.complete}
        values = {one.name: json.dumps(_entry(one)) for one in self.differences}
        return status_of(self.NAME, self.level, self.summary, counts | values)

    @classmethod
    def from_message(cls, message: DiagnosticArray) -> Self | None:
        """Return the comparison in /uam/autopilot/state, None without one; raises BadMessage."""
        status = next((s for s in message.status if s.name == cls.NAME), None)
        if status is None:
            return None
        texts = texts_of(status)
        try:
            read, required = int(texts.pop("read")), int(texts.pop("required"))
            complete = texts.pop("complete") == "True"
            differences = tuple(_difference(name, text) for name, text in texts.items())
        except (KeyError, ValueError, TypeError) as error:
            raise BadMessage(f"{cls.NAME}: {error!r}") from None
        return cls(read, required, complete, differences)


def _entry(one: ParameterDifference) -> dict[str, float | str | None]:
    return {"found": one.found, "required": one.required, "why": one.why}


def _difference(name: str, text: str) -> ParameterDifference:
    entry = read_json(text)
    found = entry["found"]
    return ParameterDifference(
        name, None if found is None else float(found), str(entry["required"]), str(entry["why"])
    )
