"""What /uam/faults says: a fault that was put into the flight has come, or has gone."""

import json
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.stamps import nanoseconds
from uam_msgs_py.messages.status import OK, WARN, diagnostic

BEGUN, OVER = "begun", "over"
NUMBER = "number"


@dataclass(frozen=True)
class FaultEvent:
    """The beginning or the end of one fault.

    place: what it acts on; number: in the order of those of its place, the same at both ends.
    """

    name: str
    place: str
    number: int
    active: bool
    parameters: dict[str, Any] = field(default_factory=dict)

    def to_message(self, stamp: int) -> DiagnosticArray:
        """Return the message; stamp [ns]: when it came or went."""
        said = {name: json.dumps(value) for name, value in self.parameters.items()}
        values = {NUMBER: self.number, "place": self.place} | said
        level = WARN if self.active else OK
        return diagnostic(stamp, self.name, level, BEGUN if self.active else OVER, values)

    @classmethod
    def from_message(cls, message: DiagnosticArray) -> "tuple[int, FaultEvent]":
        """Return (stamp [ns], event); raises BadMessage for something else."""
        try:
            (status,) = message.status
            said = {pair.key: pair.value for pair in status.values}
            number, place = int(said.pop(NUMBER)), said.pop("place")
            parameters = {name: json.loads(text) for name, text in said.items()}
            active = {BEGUN: True, OVER: False}[status.message]
        except (KeyError, ValueError):
            raise BadMessage("not a fault") from None
        return nanoseconds(message.header.stamp), cls(
            status.name, place, number, active, parameters
        )
