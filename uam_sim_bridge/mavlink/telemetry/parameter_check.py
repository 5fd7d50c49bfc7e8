"""Requests the autopilot's parameters, compares them with the bridge's mapping, or adopts them.

PX4 sends an integer parameter as four bytes in the float field of PARAM_VALUE; param_type gives
the type.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator
from dataclasses import replace

from uam_sim_bridge.mavlink.offboard.setpoint import RateThrustParameters
from uam_sim_bridge.mavlink.protocol.wire import Message, clean_text, mavlink2

_AXES = ("ROLLRATE", "PITCHRATE", "YAWRATE")
# parameters read from the autopilot; those that the mapping does not use are only recorded
WATCHED = (
    *(f"MC_{axis}_{what}" for axis in _AXES for what in "PIDK"),
    "THR_MDL_FAC", "MPC_THR_HOVER", "COM_OF_LOSS_T",
)  # fmt: skip
_TOLERANCE = 1e-4  # relative: MAVLink carries 32-bit numbers
RETRY, ATTEMPTS = 0.5, 10  # s between requests, number of requests
HICCUP = 0.5  # s, longest normal gap in the setpoint stream (busy computer or link)
_INTEGERS = {
    mavlink2.MAV_PARAM_TYPE_UINT8: "<Bxxx", mavlink2.MAV_PARAM_TYPE_INT8: "<bxxx",
    mavlink2.MAV_PARAM_TYPE_UINT16: "<Hxx", mavlink2.MAV_PARAM_TYPE_INT16: "<hxx",
    mavlink2.MAV_PARAM_TYPE_UINT32: "<I", mavlink2.MAV_PARAM_TYPE_INT32: "<i",
}  # fmt: skip


def value_of(message: Message) -> float:
    """Return the value of a PARAM_VALUE, for float and integer parameters."""
    layout = _INTEGERS.get(message.param_type)
    if layout is None:
        return message.param_value
    return float(struct.unpack(layout, struct.pack("<f", message.param_value))[0])


def expected(mapping: RateThrustParameters) -> dict[str, float]:
    """Return the autopilot's parameters, by name, that the mapping assumes."""
    values = {"THR_MDL_FAC": mapping.thr_mdl_fac}
    for axis, p, k in zip(_AXES, mapping.rate_p, mapping.rate_k, strict=True):
        values[f"MC_{axis}_P"], values[f"MC_{axis}_K"] = p, k
    return values


def differences(mapping: RateThrustParameters, values: dict[str, float]) -> Iterator[str]:
    """Yield one line for each parameter in `values` that disagrees with the mapping."""
    for name, assumed in expected(mapping).items():
        found = values.get(name)
        if found is not None and not math.isclose(
            found, assumed, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE
        ):
            yield f"{name} is {found:g} on the autopilot, the bridge assumes {assumed:g}"


def adopted(mapping: RateThrustParameters, values: dict[str, float]) -> RateThrustParameters:
    """Return the mapping with the autopilot's values in place of the assumed ones.

    Raises ParameterError, naming the value, if a value is outside the mapping's range.
    """
    if not any(True for _ in differences(mapping, values)):
        return mapping
    taken = expected(mapping) | values

    def axes(what: str) -> tuple[float, ...]:
        # 32-bit floats have seven digits: 0.15, not 0.15000000596
        return tuple(float(f"{taken[f'MC_{axis}_{what}']:.7g}") for axis in _AXES)

    return replace(
        mapping,
        rate_p=axes("P"),
        rate_k=axes("K"),
        thr_mdl_fac=float(f"{taken['THR_MDL_FAC']:.7g}"),
    ).validated()


def stream_loss(values: dict[str, float]) -> Iterator[str]:
    """Yield a warning if COM_OF_LOSS_T is shorter than HICCUP.

    On a loss of controller commands the bridge itself streams a level hold. COM_OF_LOSS_T covers
    a loss of the bridge or of the link.
    """
    wait = values.get("COM_OF_LOSS_T")
    if wait is None:
        return
    if wait <= 0.0:
        yield "COM_OF_LOSS_T is 0 on the autopilot: any late setpoint starts its failsafe"
    elif wait < HICCUP * (1.0 - _TOLERANCE):
        yield (
            f"COM_OF_LOSS_T is {wait:g} s on the autopilot: a gap of {HICCUP:g} s between "
            "setpoints starts its failsafe; set a longer time"
        )


def unanswered(names: Iterable[str], attempts: int) -> Iterator[str]:
    """Yield one line for each parameter that the autopilot has not sent."""
    for name in names:
        yield f"{name}: no answer from the autopilot to {attempts} requests"


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
