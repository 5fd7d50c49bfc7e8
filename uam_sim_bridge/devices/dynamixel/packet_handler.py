"""The maker's packet handler with its byte stuffing mended.

dynamixel-sdk 4.1.0 computes the stuffed packet and sends the one without (addStuffing assigns to
its argument's name), and after one removed byte compares bytes it has already moved
(removeStuffing). Data with FF FF FD is then refused or damaged.
"""

from __future__ import annotations

from uam_sim_bridge.devices.dynamixel.sdk import Protocol2PacketHandler

PATTERN, STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
BODY = 7  # first byte behind the length; the last two bytes are the CRC


class StuffingPacketHandler(Protocol2PacketHandler):
    """Protocol 2.0 of the maker's library with correct stuffing."""

    def addStuffing(self, packet: list[int]) -> list[int]:
        """Insert FD behind each FF FF FD of the body, in place."""
        return _replaced(packet, PATTERN, STUFFED)

    def removeStuffing(self, packet: list[int]) -> list[int]:
        """Remove the inserted bytes, in place."""
        return _replaced(packet, STUFFED, PATTERN)


def _replaced(packet: list[int], old: bytes, new: bytes) -> list[int]:
    end = BODY + packet[5] + 256 * packet[6] - 2
    body = bytes(packet[BODY:end]).replace(old, new)
    packet[BODY:end] = body
    packet[5:7] = (len(body) + 2).to_bytes(2, "little")
    return packet
