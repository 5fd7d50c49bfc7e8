"""Asks for the autopilot's parameters until they are known, and compares them with the mapping."""

from __future__ import annotations

import math

from uam_sim_bridge.mavlink.offboard.setpoint import RateThrustParameters
from uam_sim_bridge.mavlink.protocol.wire import Message, clean_text
from uam_sim_bridge.mavlink.telemetry.parameter_check import (
    WATCHED,
    differences,
    expected,
    stream_loss,
    untold,
    value_of,
)

RETRY, ATTEMPTS = 0.5, 10  # s, times


class ParameterWatch:
    """`values`: by name, the autopilot's parameters that are WATCHED; `warnings`: one line each."""

    def __init__(self, mapping: RateThrustParameters) -> None:
        self.values: dict[str, float] = {}
        self.warnings: tuple[str, ...] = ()
        self._mapping = mapping
        self.restart()

    def restart(self) -> None:
        """Ask for all of them anew."""
        self.values.clear()
        self._asked, self._attempts = -math.inf, 0
        self._compare()

    def set_mapping(self, mapping: RateThrustParameters) -> None:
        """Compare with another mapping from now on."""
        self._mapping = mapping
        self._compare()

    @property
    def mapping_told(self) -> bool:
        """Whether the autopilot has told every parameter that the mapping assumes."""
        return all(name in self.values for name in expected(self._mapping))

    def take(self, message: Message) -> None:
        """Note a PARAM_VALUE; of those that are not WATCHED there may be any number."""
        name = clean_text(message.param_id)
        if name in WATCHED:
            self.values[name] = value_of(message)
            self._compare()

    def due(self, time: float) -> list[str]:
        """Names to ask for at the tick `time` [s]; after ATTEMPTS times none, and a warning."""
        if time - self._asked < RETRY or self._attempts > ATTEMPTS:
            return []
        missing = self._missing
        if not missing:
            return []
        self._asked = time
        self._attempts += 1
        if self._attempts > ATTEMPTS:  # the last answers have had their time
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
            *untold(self._missing if self._attempts > ATTEMPTS else [], ATTEMPTS),
        )
