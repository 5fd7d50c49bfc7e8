"""Content of /uam/parameter_changes, each request and its result, and of /uam/faults."""

import json
import re
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from uam_control.settings.json_text import read_json
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.status import OK, WARN, diagnostic, only_status

ACCEPTED = "accepted"
REFUSED = "refused: "
ARROW = " -> "
BY = "by"
PARAMETER_LEVELS = 2  # a value, or a list of values
MOST_ARROWS = 20  # that are tried in a text
BEGUN, OVER = "begun", "over"
NUMBER = "number"


@dataclass(frozen=True)
class ParameterChange:
    """One request, which may change several values at once. old: None without such a parameter."""

    node: str
    by: str  # the service of the request, or the part of the node that requested the change
    values: dict[str, tuple[Any, Any]] = field(default_factory=dict)  # name → (old, new)
    reason: str = ""  # of a refusal, one line; "" if accepted

    @property
    def accepted(self) -> bool:
        """Return whether the change is in effect from the stamp of the message on."""
        return not self.reason

    def to_message(self, stamp: int) -> DiagnosticArray:
        """Return the message; stamp [ns]: the node's newest tick, 0 before the first."""
        texts = {name: _json(old) + ARROW + _json(new) for name, (old, new) in self.values.items()}
        outcome = REFUSED + self.reason if self.reason else ACCEPTED
        level = WARN if self.reason else OK
        return diagnostic(stamp, self.node, level, outcome, {BY: self.by} | texts)

    @classmethod
    def from_message(cls, message: DiagnosticArray) -> "tuple[int, ParameterChange]":
        """Return (stamp [ns], change); raises BadMessage for something else."""
        try:
            stamp, status, texts = only_status(message)
            by = texts.pop(BY)
            values = {name: _pair(text) for name, text in texts.items()}
        except (KeyError, ValueError):
            raise BadMessage("not a change of parameters") from None
        reason = "" if status.message == ACCEPTED else status.message.removeprefix(REFUSED)
        return stamp, cls(status.name, by, values, reason)


def _json(value: Any) -> str:
    return json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    """Convert a value that JSON cannot encode: arrays to lists, bytes to text."""
    return value.decode(errors="replace") if isinstance(value, bytes) else list(value)


def _pair(text: str) -> tuple[Any, Any]:
    """Return the old and new value of a text of `to_message`; a value may contain ARROW itself."""
    for arrow in islice(re.finditer(re.escape(ARROW), text), MOST_ARROWS):
        try:
            old, new = text[: arrow.start()], text[arrow.end() :]
            return read_json(old, PARAMETER_LEVELS), read_json(new, PARAMETER_LEVELS)
        except ValueError:
            continue
    raise ValueError(text)


@dataclass(frozen=True)
class FaultEvent:
    """Begin (active) or end of a fault."""

    name: str
    place: str  # plant, MAVLink or process
    number: int  # index in the schedule of its place, the same at begin and end
    active: bool
    parameters: dict[str, Any] = field(default_factory=dict)

    def to_message(self, stamp: int) -> DiagnosticArray:
        """Return the message; stamp [ns]: of the begin or end."""
        texts = {name: json.dumps(value) for name, value in self.parameters.items()}
        values = {NUMBER: self.number, "place": self.place} | texts
        level = WARN if self.active else OK
        return diagnostic(stamp, self.name, level, BEGUN if self.active else OVER, values)

    @classmethod
    def from_message(cls, message: DiagnosticArray) -> "tuple[int, FaultEvent]":
        """Return (stamp [ns], event); raises BadMessage for something else."""
        try:
            stamp, status, texts = only_status(message)
            number, place = int(texts.pop(NUMBER)), texts.pop("place")
            parameters = {name: read_json(text) for name, text in texts.items()}
            active = {BEGUN: True, OVER: False}[status.message]
        except (KeyError, ValueError):
            raise BadMessage("not a fault") from None
        return stamp, cls(status.name, place, number, active, parameters)
