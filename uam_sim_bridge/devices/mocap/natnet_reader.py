"""Frames and lists of bodies, read by the package `natnet`, with bounds for damaged packets.

The package trusts the counts in a packet: a damaged one lets it read empty names without end, or
reserve gigabytes for numbers that are not there.
"""

from __future__ import annotations

import struct

from natnet.data_descriptions import DataDescriptions
from natnet.data_frame import DataFrame
from natnet.exceptions import NatNetError
from natnet.packet_buffer import PacketBuffer
from natnet.version import Version

# what a packet that is damaged, or of a kind the package does not know, raises
UNREADABLE = (NatNetError, struct.error, UnicodeDecodeError, ValueError, OverflowError)


class BoundedBuffer(PacketBuffer):
    """A buffer that refuses to read beyond its end; raises struct.error."""

    def read_string(self, max_length: int | None = None, static_length: bool = False) -> str:
        """Return the next string."""
        self._check(1)
        return super().read_string(max_length, static_length)

    def read_float32_array(self, count: int) -> tuple[float, ...]:
        """Return the next `count` numbers."""
        self._check(4 * count)
        return super().read_float32_array(count)

    def _check(self, size: int) -> None:
        left = len(self.data) - self.pointer
        if size > left:
            raise struct.error(f"{size} bytes expected, {left} are left")


def read_frame(content: bytes, version: Version) -> DataFrame:
    """Read the content of a frame; raises one of UNREADABLE."""
    return DataFrame.read_from_buffer(BoundedBuffer(content), version)


def read_models(content: bytes, version: Version) -> DataDescriptions:
    """Read the list of bodies; raises one of UNREADABLE."""
    return DataDescriptions.read_from_buffer(BoundedBuffer(content), version)
