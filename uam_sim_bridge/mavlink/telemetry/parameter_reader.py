"""Reads parameters of the autopilot by name: which to request when, and the values received.

PX4 sends an integer parameter as four bytes in the float field of PARAM_VALUE; param_type gives
the type. Other firmwares send its value.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping

from uam_sim_bridge.mavlink.protocol.wire import Message, clean_text, mavlink2

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
