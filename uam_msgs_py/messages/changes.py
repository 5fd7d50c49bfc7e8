"""What /uam/parameter_changes says: each change that was asked of a node, and what became of it."""

import json
import re
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.stamps import nanoseconds
from uam_msgs_py.messages.status import OK, WARN, diagnostic

ACCEPTED = "accepted"
REFUSED = "refused: "
ARROW = " -> "
BY = "by"


@dataclass(frozen=True)
class ParameterChange:
    """One request, which may change several values at once.

    values: name → (old, new); old is None where the node knows no such parameter. by: the service
    through which it was asked, or what in the node itself asked. reason: why it was refused, one
    line, "" where it was accepted.
    """

    node: str
    by: str
    values: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    reason: str = ""

    @property
    def accepted(self) -> bool:
        """Whether it counts since the stamp of the message."""
        return not self.reason

    def to_message(self, stamp: int) -> DiagnosticArray:
        """Return the message; stamp [ns]: the node's newest tick, 0 before the first."""
        said = {name: _json(old) + ARROW + _json(new) for name, (old, new) in self.values.items()}
        outcome = REFUSED + self.reason if self.reason else ACCEPTED
        level = WARN if self.reason else OK
        return diagnostic(stamp, self.node, level, outcome, {BY: self.by} | said)

    @classmethod
    def from_message(cls, message: DiagnosticArray) -> "tuple[int, ParameterChange]":
        """Return (stamp [ns], change); raises BadMessage for something else."""
        try:
            (status,) = message.status
            said = {pair.key: pair.value for pair in status.values}
            by = said.pop(BY)
            values = {name: _pair(text) for name, text in said.items()}
        except (KeyError, ValueError):
            raise BadMessage("not a change of parameters") from None
        reason = "" if status.message == ACCEPTED else status.message.removeprefix(REFUSED)
        return nanoseconds(message.header.stamp), cls(status.name, by, values, reason)


def _json(value: Any) -> str:
    return json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    """What JSON has no word for: arrays, tuples come by themselves, bytes as text."""
    return value.decode(errors="replace") if isinstance(value, bytes) else list(value)


def _pair(text: str) -> tuple[Any, Any]:
    """The old and the new value of `to_message`; a text may hold an arrow, too."""
    for arrow in re.finditer(re.escape(ARROW), text):
        try:
            return json.loads(text[: arrow.start()]), json.loads(text[arrow.end() :])
        except ValueError:
            continue
    raise ValueError(text)
