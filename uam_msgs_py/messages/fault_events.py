"""Content of /uam/faults: begin or end of an injected fault."""

import json
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from uam_control.settings.json_text import read_json
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.status import OK, WARN, diagnostic, only_status

BEGUN, OVER = "begun", "over"
NUMBER = "number"


@dataclass(frozen=True)
class FaultEvent:
    """Begin (active) or end of a fault.

    place: plant, MAVLink or process; number: index in the schedule of its place, the same at begin
    and end.
    """

    name: str
    place: str
    number: int
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
