"""Reads the autopilot's parameters, compares them with the bridge's mapping, or adopts them.

PX4 sends an integer parameter as four bytes in the float field of PARAM_VALUE; param_type gives
the type. Other firmwares send its value.
"""

import math
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from uam_control.offboard.firmware import FIRMWARES, PX4, Firmware
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_sim_bridge.mavlink.protocol.wire import Message, clean_text, mavlink2
from uam_sim_bridge.mavlink.telemetry.required_parameters import (
    Difference,
    RequiredParameters,
    same,
)

WRITES = 3  # of each parameter that is set
HICCUP = 0.5  # s, longest normal gap in the setpoint stream (busy computer or link)
RETRY, ATTEMPTS = 0.5, 10  # s between requests, number of requests of each parameter
BATCH = 16  # parameters requested at once: a slow line carries them beside the setpoints
_INTEGERS = {
    mavlink2.MAV_PARAM_TYPE_UINT8: "<Bxxx", mavlink2.MAV_PARAM_TYPE_INT8: "<bxxx",
    mavlink2.MAV_PARAM_TYPE_UINT16: "<Hxx", mavlink2.MAV_PARAM_TYPE_INT16: "<hxx",
    mavlink2.MAV_PARAM_TYPE_UINT32: "<I", mavlink2.MAV_PARAM_TYPE_INT32: "<i",
}  # fmt: skip


def value_of(message: Message, as_bytes: bool = True) -> float:
    """Return the value of a PARAM_VALUE; as_bytes: see `Firmware.integers_as_bytes`."""
    layout = _INTEGERS.get(message.param_type)
    if layout is None or not as_bytes:
        return message.param_value
    return float(struct.unpack(layout, struct.pack("<f", message.param_value))[0])


def setting(name: str, value: float, kind: int, system: int, as_bytes: bool = True) -> Message:
    """Return the PARAM_SET of a parameter of the autopilot `system`; kind: MAV_PARAM_TYPE;
    as_bytes: see `Firmware.integers_as_bytes`."""
    layout = _INTEGERS.get(kind)
    if layout is not None and as_bytes:
        value = struct.unpack("<f", struct.pack(layout, round(value)))[0]
    return mavlink2.MAVLink_param_set_message(
        system, mavlink2.MAV_COMP_ID_AUTOPILOT1, name.encode(), value, kind
    )


class ParameterReader:
    """`values`: received parameters by name; `types`: their MAV_PARAM_TYPE; `given_up`: ATTEMPTS
    requests of the rest failed."""

    def __init__(
        self,
        names: Iterable[str],
        instead: Mapping[str, str] | None = None,
        as_bytes: bool = True,
    ) -> None:
        """instead: name → other one; a name is not waited for once the other has come; as_bytes:
        see `Firmware.integers_as_bytes`."""
        self._instead, self._as_bytes = dict(instead or {}), as_bytes
        self.names = tuple(dict.fromkeys(names))
        self.values: dict[str, float] = {}
        self.types: dict[str, int] = {}
        self.restart()

    def restart(self) -> None:
        """Discard all values and request them again."""
        self.values.clear()
        self.given_up = False
        self._requested = -math.inf
        self._attempts = dict.fromkeys(self.names, 0)

    @property
    def missing(self) -> list[str]:
        """Return the names without a value."""
        values, instead = self.values, self._instead
        return [n for n in self.names if n not in values and instead.get(n) not in values]

    @property
    def complete(self) -> bool:
        """Return whether nothing is waited for: all received, or given up."""
        return self.given_up or not self.missing

    def take(self, message: Message) -> str:
        """Store the value of a PARAM_VALUE and return its name; "" for other parameters."""
        name = clean_text(message.param_id)
        if name not in self._attempts:
            return ""
        self.values[name] = value_of(message, self._as_bytes)
        self.types[name] = message.param_type
        return name

    def due(self, time: float) -> list[str]:
        """Return the names to request at `time` [s], at most BATCH, the least requested first."""
        if time - self._requested < RETRY or self.complete:
            return []
        self._requested = time
        waiting = [name for name in self.missing if self._attempts[name] < ATTEMPTS]
        self.given_up = not waiting  # RETRY has passed since the last request
        batch = sorted(waiting, key=self._attempts.__getitem__)[:BATCH]
        for name in batch:
            self._attempts[name] += 1
        return batch


def request(name: str, system: int) -> Message:
    """Return the message that requests a parameter of the autopilot `system`."""
    return mavlink2.MAVLink_param_request_read_message(
        system, mavlink2.MAV_COMP_ID_AUTOPILOT1, name.encode(), -1
    )


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


class ParameterWatch(ParameterReader):
    """Reads the firmware's watched parameters and those required, and compares them.

    `warnings`: one line per problem, of missing parameters after ATTEMPTS requests; `writing`:
    whether `to_write` returns parameters; `written`: one line per parameter that it has returned.
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
        self._mapping = mapping
        self.writing, self.written = False, ()
        self._writes: dict[str, int] = {}  # of parameters whose first value was not the required
        self._write_due = -math.inf
        names = (*spoken.watched, *self.required)
        super().__init__(names, self.required.instead, spoken.integers_as_bytes)

    def restart(self) -> None:
        super().restart()
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
    def expected(self) -> list[str]:
        """Return the required parameters that this autopilot has, or should have."""
        waited = set(self.missing)
        return [name for name in self.required if name in self.values or name in waited]

    @property
    def differences(self) -> tuple[Difference, ...]:
        """Return the differences from the required parameters; unanswered ones once complete."""
        return self.required.differences(self.values, unanswered=self.complete)

    def take(self, message: Message) -> str:
        known = set(self.values)
        name = super().take(message)
        if not name:
            return ""
        rule = self.required.get(name)
        wrong = rule is not None and len(rule.values) == 1 and not rule.met(self.values[name])
        if wrong and name not in known:
            self._writes[name] = 0
        else:  # the answer, or changed by somebody else, who keeps it
            self._writes.pop(name, None)
        self._compare()
        return name

    def due(self, time: float) -> list[str]:
        before, names = self.given_up, super().due(time)
        if self.given_up is not before:
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
                due.append((name, value, self.types[name]))
        return due

    def _compare(self) -> None:
        given_up = self.missing if self.given_up else ()
        self.warnings = (
            *differences(self._mapping, self.values, self._spoken),
            *stream_loss(self.values, self._spoken),
            *unanswered((name for name in given_up if name not in self.required), ATTEMPTS),
            *(difference.text for difference in self.differences),
        )
