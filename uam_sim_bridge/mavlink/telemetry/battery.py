"""Battery state from BATTERY_STATUS, or from SYS_STATUS until BATTERY_STATUS reports a voltage."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uam_sim_bridge.mavlink.protocol.wire import Message

_UNKNOWN_VOLTAGE = 0xFFFF  # mV
_UNKNOWN_TEMPERATURE = 0x7FFF
_NAN = math.nan


@dataclass(frozen=True)
class Battery:
    """State of the battery; NaN means unknown.

    voltage [V]; current [A], positive for discharge; left: state of charge 0..1; consumed [A h];
    temperature [deg C]; cells: cell voltages [V], () if only their sum is measured.
    """

    voltage: float = _NAN
    current: float = _NAN
    left: float = _NAN
    consumed: float = _NAN
    temperature: float = _NAN
    cells: tuple[float, ...] = ()

    @property
    def known(self) -> bool:
        """Return whether the autopilot measures a battery voltage."""
        return math.isfinite(self.voltage)


def from_battery_status(m: Message) -> Battery:
    """Return the battery state of a BATTERY_STATUS.

    Without cell voltages PX4 puts the sum into the first cell. A cell field holds at most
    65.534 V; PX4 puts the remainder into the next field.
    """
    cells = [v for v in m.voltages if v != _UNKNOWN_VOLTAGE]
    cells += [v for v in m.voltages_ext if v not in (0, _UNKNOWN_VOLTAGE)]
    known = sum(cells) > 0
    return Battery(
        voltage=1e-3 * sum(cells) if known else _NAN,
        current=_unless(m.current_battery, -1, 0.01),
        left=_unless(m.battery_remaining, -1, 0.01),
        consumed=_unless(m.current_consumed, -1, 1e-3),
        temperature=_unless(m.temperature, _UNKNOWN_TEMPERATURE, 0.01),
        cells=tuple(1e-3 * v for v in cells) if known and len(cells) > 1 else (),
    )


def from_sys_status(m: Message) -> Battery:
    """Return the battery state of a SYS_STATUS."""
    voltage = _unless(m.voltage_battery, _UNKNOWN_VOLTAGE, 1e-3)
    return Battery(
        voltage=voltage if voltage > 0.0 else _NAN,
        current=_unless(m.current_battery, -1, 0.01),
        left=_unless(m.battery_remaining, -1, 0.01),
    )


def _unless(value: int, unknown: int, scale: float) -> float:
    return _NAN if value == unknown else scale * value
