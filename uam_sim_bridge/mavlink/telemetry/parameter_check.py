"""Compares the autopilot's parameters with the bridge's mapping, or adopts them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

from uam_control.offboard.firmware import FIRMWARES, PX4, Firmware
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_sim_bridge.mavlink.protocol.wire import Message
from uam_sim_bridge.mavlink.telemetry.parameter_reader import ATTEMPTS, RETRY, ParameterReader
from uam_sim_bridge.mavlink.telemetry.required_parameters import (
    Difference,
    RequiredParameters,
    same,
)

WRITES = 3  # of each parameter that is set
HICCUP = 0.5  # s, longest normal gap in the setpoint stream (busy computer or link)


def expected(mapping: RateThrustParameters, spoken: Firmware = FIRMWARES[PX4]) -> dict[str, float]:
    """Return the autopilot's parameters, by name, that the mapping assumes."""
    values = ((name, getattr(mapping, field), i) for name, (field, i) in spoken.mapped.items())
    return {name: value if axis is None else value[axis] for name, value, axis in values}


def differences(
    mapping: RateThrustParameters, values: dict[str, float], spoken: Firmware = FIRMWARES[PX4]
) -> Iterator[str]:
    """Yield one line for each parameter in `values` that disagrees with the mapping."""
    for name, assumed in expected(mapping, spoken).items():
        found = values.get(name)
        if found is not None and not same(found, assumed):
            yield f"{name} is {found:g} on the autopilot, the bridge assumes {assumed:g}"


def adopted(
    mapping: RateThrustParameters, values: dict[str, float], spoken: Firmware = FIRMWARES[PX4]
) -> RateThrustParameters:
    """Return the mapping with the autopilot's values in place of the assumed ones.

    Raises ParameterError, naming the value, if a value is outside the mapping's range.
    """
    if not any(True for _ in differences(mapping, values, spoken)):
        return mapping
    taken: dict[str, Any] = {}
    for name, (field, axis) in spoken.mapped.items():
        if name not in values:
            continue
        # 32-bit floats have seven digits: 0.15, not 0.15000000596
        value = float(f"{values[name]:.7g}")
        if axis is not None:
            vector = list(taken.get(field, getattr(mapping, field)))
            vector[axis], value = value, vector
        taken[field] = tuple(value) if axis is not None else value
    return replace(mapping, **taken).validated()


def stream_loss(values: dict[str, float], spoken: Firmware = FIRMWARES[PX4]) -> Iterator[str]:
    """Yield a warning if the time of a lost stream (PX4: COM_OF_LOSS_T) is shorter than HICCUP.

    On a loss of controller commands the bridge itself streams a level hold. This time covers a loss
    of the bridge or of the link.
    """
    wait = values.get(spoken.loss_time)
    if wait is None:
        return
    if wait <= 0.0:
        yield f"{spoken.loss_time} is 0 on the autopilot: any late setpoint starts its failsafe"
    elif wait < HICCUP and not same(wait, HICCUP):
        yield (
            f"{spoken.loss_time} is {wait:g} s on the autopilot: a gap of {HICCUP:g} s between "
            "setpoints starts its failsafe; set a longer time"
        )


def unanswered(names: Iterable[str], attempts: int) -> Iterator[str]:
    """Yield one line for each parameter that the autopilot has not sent."""
    for name in names:
        yield f"{name}: no answer from the autopilot to {attempts} requests"


class ParameterWatch:
    """Reads the firmware's watched parameters and those required, and compares them.

    `values`: received parameters by name; `warnings`: one line per problem; `writing`: whether
    `to_write` returns parameters; `written`: one line per parameter that it has returned.
    """

    def __init__(
        self,
        mapping: RateThrustParameters,
        required: RequiredParameters | None = None,
        spoken: Firmware = FIRMWARES[PX4],
    ) -> None:
        """spoken: the firmware whose parameters these are."""
        self._spoken = spoken
        self.warnings: tuple[str, ...] = ()
        self.required = RequiredParameters() if required is None else required
        names = (*spoken.watched, *self.required)
        self._reader = ParameterReader(names, self.required.instead, spoken.integers_as_bytes)
        self.values = self._reader.values
        self._mapping = mapping
        self.writing, self.written = False, ()
        self._writes: dict[str, int] = {}  # of parameters whose first value was not the required
        self._write_due = -math.inf
        self._compare()

    def restart(self) -> None:
        """Discard all values and request them again."""
        self._reader.restart()
        self._writes.clear()
        self._compare()

    def set_mapping(self, mapping: RateThrustParameters) -> None:
        """Compare with this mapping from now on."""
        self._mapping = mapping
        self._compare()

    @property
    def mapping_read(self) -> bool:
        """Return whether every parameter that the mapping assumes has been received."""
        return all(name in self.values for name in expected(self._mapping, self._spoken))

    @property
    def complete(self) -> bool:
        """Return whether nothing is waited for: all received, or ATTEMPTS requests in vain."""
        return self._reader.complete

    @property
    def expected(self) -> list[str]:
        """Return the required parameters that this autopilot has, or should have."""
        waited = set(self._reader.missing)
        return [name for name in self.required if name in self.values or name in waited]

    @property
    def differences(self) -> tuple[Difference, ...]:
        """Return the differences from the required parameters; unanswered ones once complete."""
        return self.required.differences(self.values, unanswered=self.complete)

    def take(self, message: Message) -> None:
        """Store the value of a PARAM_VALUE; other parameters are ignored."""
        known = set(self.values)
        name = self._reader.take(message)
        if not name:
            return
        rule = self.required.get(name)
        wrong = rule is not None and len(rule.values) == 1 and not rule.met(self.values[name])
        if wrong and name not in known:
            self._writes[name] = 0
        else:  # the answer, or changed by somebody else, who keeps it
            self._writes.pop(name, None)
        self._compare()

    def due(self, time: float) -> list[str]:
        """Return the names to request at the tick `time` [s].

        After ATTEMPTS requests of each the list is empty and `warnings` names the missing ones.
        """
        before = self._reader.given_up
        names = self._reader.due(time)
        if self._reader.given_up is not before:
            self._compare()
        return names

    def to_write(self, time: float) -> list[tuple[str, float, int]]:
        """Return name, value and MAV_PARAM_TYPE of the parameters to write at `time` [s].

        Those with one required value whose first value differed, until an answer comes, at most
        WRITES times each. What somebody else changes later stays as it is.
        """
        if not self.writing or time < self._write_due:
            return []
        self._write_due = time + RETRY
        due = []
        for name, count in self._writes.items():
            (value,) = self.required[name].values
            if count == 0:
                found = self.values[name]
                self.written += (f"{name} was {found:.9g}: set to {value:.9g}",)
            if count < WRITES:
                self._writes[name] = count + 1
                due.append((name, value, self._reader.types[name]))
        return due

    def _compare(self) -> None:
        given_up = self._reader.missing if self._reader.given_up else ()
        self.warnings = (
            *differences(self._mapping, self.values, self._spoken),
            *stream_loss(self.values, self._spoken),
            *unanswered((name for name in given_up if name not in self.required), ATTEMPTS),
            *(difference.text for difference in self.differences),
        )
