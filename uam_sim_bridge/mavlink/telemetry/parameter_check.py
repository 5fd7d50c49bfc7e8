"""Whether the autopilot's parameters are those that the bridge's mapping assumes; or to adopt them.

PX4 carries an integer parameter as its four bytes in the place of PARAM_VALUE's float; param_type
says which it is.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator
from dataclasses import replace

from uam_sim_bridge.mavlink.offboard.setpoint import RateThrustParameters
from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2

_AXES = ("ROLLRATE", "PITCHRATE", "YAWRATE")
# read from the autopilot; those without a counterpart in the mapping are for the record
WATCHED = (
    *(f"MC_{axis}_{what}" for axis in _AXES for what in "PIDK"),
    "THR_MDL_FAC", "MPC_THR_HOVER", "COM_OF_LOSS_T",
)  # fmt: skip
_TOLERANCE = 1e-4  # relative: MAVLink carries 32-bit numbers
HICCUP = 0.5  # [s] without setpoints, by a busy computer or link
_INTEGERS = {
    mavlink2.MAV_PARAM_TYPE_UINT8: "<Bxxx", mavlink2.MAV_PARAM_TYPE_INT8: "<bxxx",
    mavlink2.MAV_PARAM_TYPE_UINT16: "<Hxx", mavlink2.MAV_PARAM_TYPE_INT16: "<hxx",
    mavlink2.MAV_PARAM_TYPE_UINT32: "<I", mavlink2.MAV_PARAM_TYPE_INT32: "<i",
}  # fmt: skip


def value_of(message: Message) -> float:
    """Return the value in a PARAM_VALUE, whatever its type."""
    layout = _INTEGERS.get(message.param_type)
    if layout is None:
        return message.param_value
    return float(struct.unpack(layout, struct.pack("<f", message.param_value))[0])


def expected(mapping: RateThrustParameters) -> dict[str, float]:
    """Return what the autopilot's parameters should be for the mapping to be right."""
    values = {"THR_MDL_FAC": mapping.thr_mdl_fac}
    for axis, p, k in zip(_AXES, mapping.rate_p, mapping.rate_k, strict=True):
        values[f"MC_{axis}_P"], values[f"MC_{axis}_K"] = p, k
    return values


def differences(mapping: RateThrustParameters, values: dict[str, float]) -> Iterator[str]:
    """Yield one line for each parameter in `values` that disagrees with the mapping."""
    for name, wanted in expected(mapping).items():
        found = values.get(name)
        if found is not None and not math.isclose(
            found, wanted, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE
        ):
            yield f"{name} is {found:g} on the autopilot, the bridge assumes {wanted:g}"


def adopted(mapping: RateThrustParameters, values: dict[str, float]) -> RateThrustParameters:
    """Return the mapping with the autopilot's own values where they differ from it.

    Raises ParameterError, naming the value, where one is out of the range of the mapping.
    """
    if not any(True for _ in differences(mapping, values)):
        return mapping
    taken = expected(mapping) | values

    def axes(what: str) -> tuple[float, ...]:
        # seven digits are what 32 bits carry: 0.15, not 0.15000000596
        return tuple(float(f"{taken[f'MC_{axis}_{what}']:.7g}") for axis in _AXES)

    return replace(
        mapping,
        rate_p=axes("P"),
        rate_k=axes("K"),
        thr_mdl_fac=float(f"{taken['THR_MDL_FAC']:.7g}"),
    ).validated()


def stream_loss(values: dict[str, float]) -> Iterator[str]:
    """Yield what is wrong with COM_OF_LOSS_T, which should be longer than a hiccup of the stream.

    A loss of commands is the bridge's to bridge, by its level hold; the autopilot sees that of the
    bridge itself and of the link.
    """
    wait = values.get("COM_OF_LOSS_T")
    if wait is None:
        return
    if wait <= 0.0:
        yield "COM_OF_LOSS_T is 0 on the autopilot: any late setpoint is a failsafe"
    elif wait < HICCUP * (1.0 - _TOLERANCE):
        yield (
            f"COM_OF_LOSS_T is {wait:g} s on the autopilot: a hiccup of {HICCUP:g} s should not "
            "be a failsafe"
        )


def untold(names: Iterable[str], attempts: int) -> Iterator[str]:
    """Yield one line for each parameter that was asked for in vain."""
    for name in names:
        yield f"{name} was not told by the autopilot in {attempts} requests"
