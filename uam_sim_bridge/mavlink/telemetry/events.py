"""Converts PX4's EVENT messages to text without the metadata file of a ground station.

An EVENT carries a hash of the event's name and up to 40 bytes of arguments. config/px4/events.yaml
lists the events about arming and about loss of OFFBOARD, with PX4's texts (v1.16.0), and the names
of the others. PX4 sends the arming checks as one report:

    summary (which modes may be armed)  →  one event per failed check  →  health summary

A check lists the modes that it concerns, but some checks list all modes and block none. The reader
therefore returns checks only if the summary excludes arming in OFFBOARD.

MAVLink marks EVENT as work in progress, so pymavlink omits it; it is added to the dialect on
import. PX4 reports most failed arming checks only as EVENT.
"""

import struct
from typing import Any

from pymavlink.dialects.v20 import development as mavlink2

from uam_control.offboard.firmware import FIRMWARES, PX4, Firmware
from uam_control.offboard.modes import Severity

ARGUMENTS = 40  # bytes
OFFBOARD = 1 << 14  # PX4's navigation_mode_group of OFFBOARD
_AUTOPILOT = 1 << 24  # component of the event's name
SUMMARY, HEALTH_SUMMARY = "commander_arming_check_summary", "commander_health_summary"

# PX4 lists all modes for these checks; they block OFFBOARD only from severity ERROR on
_OPTIONAL = {"check_modes_manual_control", "check_rc_dl_no_dllink"}
_RAISED = {"commander_rc_override", "failsafe_rc_override"}  # severity INFO in PX4, WARNING here


_FIELDS = (  # `event` is MAVLink's `id`, which in pymavlink is the number of the message
    *("destination_component", "destination_system", "event", "event_time_boot_ms"),
    *("sequence", "log_levels", "arguments"),
)


class EventMessage(mavlink2.MAVLink_message):
    """EVENT; `arguments`: up to ARGUMENTS bytes; decoding removes trailing zeros."""

    id, msgname = 410, "EVENT"
    orders = [3, 4, 0, 1, 2, 5, 6]  # places of _FIELDS on the wire
    lengths = [1, 1, 1, 1, 1, 1, ARGUMENTS]
    crc_extra = 160
    unpacker = struct.Struct(f"<IIHBBB{ARGUMENTS}s")

    def __init__(self, *values: int | bytes) -> None:
        """values: of _FIELDS."""
        super().__init__(self.id, self.msgname)
        for name, value in zip(_FIELDS, values, strict=True):
            setattr(self, name, value)

    def pack(self, mav: mavlink2.MAVLink, force_mavlink1: bool = False) -> bytes:
        values = (getattr(self, name) for _, name in sorted(zip(self.orders, _FIELDS, strict=True)))
        payload = self.unpacker.pack(*values)
        return self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)


mavlink2.mavlink_map.setdefault(EventMessage.id, EventMessage)


def event_id(name: str) -> int:
    """Return the id of an autopilot event: 24 low bits of FNV-1a(name), component in the high 8."""
    value = 0x811C9DC5
    for byte in name.encode():
        value = (value ^ byte) * 0x1000193 & 0xFFFFFFFF
    return value & 0xFFFFFF | _AUTOPILOT


class EventTexts:
    """Texts of a firmware's events by name: (text, struct format of {0}, {1}, ...).

    `checks`: of arming and health; `others`; `names`: event's id → name of every known event.
    """

    def __init__(self, spoken: Firmware) -> None:
        self._given: dict[str, Any] = spoken.table("events")
        self.checks, self.others = self._table("checks"), self._table("others")
        every = *self._given.get("names", ()), *self.checks, *self.others, SUMMARY, HEALTH_SUMMARY
        self.names = {event_id(name): name for name in every}

    def _table(self, section: str) -> dict[str, tuple[str, str]]:
        found = self._given.get(section, {}).items()
        return {name: (text, "") if isinstance(text, str) else tuple(text) for name, text in found}

    def failsafe(self, name: str, arguments: bytes) -> str:
        """Return the text of one of `others` with its arguments, action and cause in words."""
        text, layout = self.others[name]
        values = struct.unpack_from("<" + layout, arguments)
        action = self._word("actions", values[1]) if len(values) > 1 else ""
        cause = self._word("causes", values[-1]) if "{cause}" in text else ""
        return text.format(*values, action=action, cause=cause)

    def _word(self, section: str, index: int) -> str:
        words = self._given[section]
        return words[index] if index < len(words) else str(index)


class EventReader:
    """Converts EVENT messages to text; stores whether the last summary excludes OFFBOARD."""

    def __init__(self, spoken: Firmware = FIRMWARES[PX4]) -> None:
        """spoken: the firmware whose events these are."""
        self._texts = EventTexts(spoken)
        self._blocked = False
        self._last: int | None = None

    def read(self, message: EventMessage) -> tuple[int, str] | None:
        """Return severity (MAV_SEVERITY) and text; None for events without a text here."""
        if message.sequence == self._last:  # repeated event
            return None
        self._last = message.sequence
        name = self._texts.names.get(message.event, "")
        arguments = bytes(message.arguments).ljust(ARGUMENTS, b"\0")
        severity = message.log_levels & 0xF
        if name == SUMMARY:
            _, _, _, can_arm, _ = struct.unpack_from("<BIIII", arguments)
            self._blocked = not can_arm & OFFBOARD
        elif name in self._texts.checks:
            return self._check(name, severity, arguments)
        elif name in self._texts.others:
            if name in _RAISED:
                severity = min(severity, Severity.WARNING)
            return severity, self._texts.failsafe(name, arguments)
        elif severity <= Severity.ERROR:
            known = f"event {name}" if name else f"event {message.event:#010x}, of unknown name"
            return severity, f"{known}: see PX4's log"
        return None

    def _check(self, name: str, severity: int, arguments: bytes) -> tuple[int, str] | None:
        text, layout = self._texts.checks[name]
        modes, _component, *values = struct.unpack_from("<IB" + layout, arguments)
        if not self._blocked or not modes & OFFBOARD:
            return None
        if name in _OPTIONAL and severity > Severity.ERROR:
            return None
        # blocks arming: at least WARNING, also where PX4 sends INFO
        return min(severity, Severity.WARNING), text.format(*values)
