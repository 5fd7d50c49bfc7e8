"""The message EVENT, added to pymavlink's dialect on import.

MAVLink marks it as work in progress, so pymavlink omits it. PX4 reports most failed arming checks
only as EVENT.
"""

from __future__ import annotations

import struct

from pymavlink.dialects.v20 import development as mavlink2

ARGUMENTS = 40  # bytes


class EventMessage(mavlink2.MAVLink_message):
    """EVENT; `arguments`: up to ARGUMENTS bytes; decoding removes trailing zeros."""

    id = 410
    msgname = "EVENT"
    fieldnames = [
        "destination_component",
        "destination_system",
        "id",
        "event_time_boot_ms",
        "sequence",
        "log_levels",
        "arguments",
    ]
    ordered_fieldnames = [
        "id",
        "event_time_boot_ms",
        "sequence",
        "destination_component",
        "destination_system",
        "log_levels",
        "arguments",
    ]
    fieldtypes = ["uint8_t", "uint8_t", "uint32_t", "uint32_t", "uint16_t", "uint8_t", "uint8_t"]
    fielddisplays_by_name: dict[str, str] = {}
    fieldenums_by_name: dict[str, str] = {}
    fieldunits_by_name: dict[str, str] = {"event_time_boot_ms": "ms"}
    native_format = bytearray(b"<IIHBBBB")
    orders = [3, 4, 0, 1, 2, 5, 6]
    lengths = [1, 1, 1, 1, 1, 1, ARGUMENTS]
    array_lengths = [0, 0, 0, 0, 0, 0, ARGUMENTS]
    crc_extra = 160
    unpacker = struct.Struct(f"<IIHBBB{ARGUMENTS}s")
    instance_field = None
    instance_offset = -1

    def __init__(
        self,
        destination_component: int,
        destination_system: int,
        id: int,
        event_time_boot_ms: int,
        sequence: int,
        log_levels: int,
        arguments: bytes,
    ):
        super().__init__(EventMessage.id, EventMessage.msgname)
        self._fieldnames = EventMessage.fieldnames
        self._instance_field, self._instance_offset = None, -1
        self.destination_component = destination_component
        self.destination_system = destination_system
        self.event = id  # not `self.id`: that is the message id
        self.event_time_boot_ms = event_time_boot_ms
        self.sequence = sequence
        self.log_levels = log_levels
        self.arguments = arguments

    def pack(self, mav: mavlink2.MAVLink, force_mavlink1: bool = False) -> bytes:
        """Return the frame."""
        payload = self.unpacker.pack(
            self.event,
            self.event_time_boot_ms,
            self.sequence,
            self.destination_component,
            self.destination_system,
            self.log_levels,
            self.arguments,
        )
        return self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)


mavlink2.mavlink_map.setdefault(EventMessage.id, EventMessage)
