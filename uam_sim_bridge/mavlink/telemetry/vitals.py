"""Battery, estimator, sensor and processor state that the autopilot has reported.

PX4's EKF2 sets `attitude`, velocity and position flags when these estimates are valid. It sets
`const_pos_mode` without an aiding source (it then assumes zero velocity), and `accel_error` when
vibration degrades the height estimate. The battery's state comes from BATTERY_STATUS, and from
SYS_STATUS until BATTERY_STATUS reports a voltage.
"""

import math
from dataclasses import dataclass

from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2

_UNKNOWN_VOLTAGE = 0xFFFF  # mV
_UNKNOWN_TEMPERATURE = 0x7FFF
_NAN = math.nan


@dataclass(frozen=True)
class Battery:
    """State of the battery; NaN means unknown."""

    voltage: float = _NAN  # [V]
    current: float = _NAN  # [A] positive for discharge
    left: float = _NAN  # state of charge, 0..1
    consumed: float = _NAN  # [A h]
    temperature: float = _NAN  # [deg C]
    cells: tuple[float, ...] = ()  # [V]; (): only their sum is measured

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


def _names(enum: str, prefix: str) -> dict[int, str]:
    return {
        bit: entry.name.removeprefix(prefix).lower()
        for bit, entry in mavlink2.enums[enum].items()
        if bit & (bit - 1) == 0 and not entry.name.endswith("ENUM_END")
    }


ESTIMATOR_FLAGS = _names("ESTIMATOR_STATUS_FLAGS", "ESTIMATOR_")
SENSORS = {
    bit: name.removeprefix("sensor_")
    for bit, name in _names("MAV_SYS_STATUS_SENSOR", "MAV_SYS_STATUS_").items()
}

ATTITUDE = mavlink2.ESTIMATOR_ATTITUDE
_HORIZONTAL = mavlink2.ESTIMATOR_POS_HORIZ_REL | mavlink2.ESTIMATOR_POS_HORIZ_ABS
_VERTICAL = mavlink2.ESTIMATOR_POS_VERT_ABS | mavlink2.ESTIMATOR_POS_VERT_AGL


def names(flags: int, table: dict[int, str]) -> tuple[str, ...]:
    """Return the names of the bits set in `flags`."""
    return tuple(name for bit, name in table.items() if flags & bit)


def estimate_faults(flags: int) -> tuple[str, ...]:
    """Return a text per fault in ESTIMATOR_STATUS.flags; () if attitude and position are valid."""
    faults = []
    if not flags & ATTITUDE:
        faults.append("no valid attitude estimate")
    if not flags & _HORIZONTAL or flags & mavlink2.ESTIMATOR_CONST_POS_MODE:
        faults.append("no horizontal position estimate")
    if not flags & _VERTICAL:
        faults.append("no height estimate")
    if flags & mavlink2.ESTIMATOR_ACCEL_ERROR:
        faults.append("accelerometer data are bad")
    return tuple(faults)


def unhealthy(present: int, enabled: int, health: int) -> tuple[str, ...]:
    """Return the names of the present, enabled and unhealthy sensors (bit masks of SYS_STATUS)."""
    return names(present & enabled & ~health, SENSORS)


@dataclass
class Vitals:
    """Newest values; None before the first message."""

    battery: Battery | None = None
    estimator_flags: int | None = None  # ESTIMATOR_STATUS.flags
    unhealthy: tuple[str, ...] = ()  # names of sensors
    load: float | None = None  # of the processor, 0..1
    radio: bool | None = None  # whether the pilot's radio is received

    def take(self, kind: str, m: Message) -> None:
        """Store BATTERY_STATUS, SYS_STATUS or ESTIMATOR_STATUS; other messages are ignored."""
        if kind == "BATTERY_STATUS" and m.id == 0:
            self.battery = from_battery_status(m)
        elif kind == "SYS_STATUS":
            self.unhealthy = unhealthy(
                m.onboard_control_sensors_present,
                m.onboard_control_sensors_enabled,
                m.onboard_control_sensors_health,
            )
            self.load = 1e-3 * m.load
            there = m.onboard_control_sensors_present & m.onboard_control_sensors_health
            self.radio = bool(there & mavlink2.MAV_SYS_STATUS_SENSOR_RC_RECEIVER)
            battery = self.battery  # SYS_STATUS says less
            if battery is None or not (battery.known or math.isfinite(battery.left)):
                self.battery = from_sys_status(m)
        elif kind == "ESTIMATOR_STATUS":
            self.estimator_flags = m.flags
