"""Requests the autopilot's parameters until all have arrived; compares them with the mapping."""

from __future__ import annotations

import math

from uam_sim_bridge.mavlink.offboard.setpoint import RateThrustParameters
from uam_sim_bridge.mavlink.protocol.wire import Message, clean_text
from uam_sim_bridge.mavlink.telemetry.parameter_check import (
    WATCHED,
    differences,
    expected,
    stream_loss,
    unanswered,
    value_of,
)

RETRY, ATTEMPTS = 0.5, 10  # s between requests, number of requests


class ParameterWatch:
    """`values`: received parameters (of WATCHED) by name; `warnings`: one line per problem."""

    def __init__(self, mapping: RateThrustParameters) -> None:
        self.values: dict[str, float] = {}
        self.warnings: tuple[str, ...] = ()
        self._mapping = mapping
        self.restart()

    def restart(self) -> None:
        """Discard all values and request them again."""
        self.values.clear()
        self._requested, self._attempts = -math.inf, 0
        self._compare()

    def set_mapping(self, mapping: RateThrustParameters) -> None:
        """Compare with this mapping from now on."""
        self._mapping = mapping
        self._compare()

    @property
    def mapping_read(self) -> bool:
        """Return whether every parameter that the mapping assumes has been received."""
        return all(name in self.values for name in expected(self._mapping))

    def take(self, message: Message) -> None:
        """Store the value of a PARAM_VALUE; parameters outside WATCHED are ignored."""
        name = clean_text(message.param_id)
        if name in WATCHED:
            self.values[name] = value_of(message)
            self._compare()

    def due(self, time: float) -> list[str]:
        """Return the names to request at the tick `time` [s].

        After ATTEMPTS requests the list is empty and `warnings` names the missing parameters.
        """
        if time - self._requested < RETRY or self._attempts > ATTEMPTS:
            return []
        missing = self._missing
        if not missing:
            return []
        self._requested = time
        self._attempts += 1
        if self._attempts > ATTEMPTS:  # RETRY has passed since the last request
            self._compare()
            return []
        return missing

    @property
    def _missing(self) -> list[str]:
        return [name for name in WATCHED if name not in self.values]

    def _compare(self) -> None:
        self.warnings = (
            *differences(self._mapping, self.values),
            *stream_loss(self.values),
            *unanswered(self._missing if self._attempts > ATTEMPTS else [], ATTEMPTS),
        )
