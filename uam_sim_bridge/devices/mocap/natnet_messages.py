"""NatNet's packets: requests of a client, the answer to the first one, frames, lists of bodies.

The package `natnet` reads frames and model definitions. It trusts the counts in a packet, so a
damaged one lets it read empty names without end, or reserve gigabytes for numbers that are not
there: here it reads with bounds. Its own client is not used: it sends a keep-alive for each packet,
a damaged packet ends its receiving thread, and it does not read the frequency of the server's
clock, without which the stamps have no unit.
"""

import struct
from typing import NamedTuple

from natnet.data_descriptions import DataDescriptions
from natnet.data_frame import DataFrame
from natnet.exceptions import NatNetError
from natnet.packet_buffer import PacketBuffer
from natnet.version import Version

CONNECT, SERVER_INFO = 0, 1
REQUEST_MODEL_DEFINITIONS, MODEL_DEFINITIONS, FRAME = 4, 5, 7
KEEP_ALIVE = 10
HEADER = struct.Struct("<HH")  # message, bytes that follow
# application, its version, NatNet's version, clock [ticks/s], data port, multicast, group
_SERVER_INFO = struct.Struct("<256s4s4sQH?4s")
_OLD_SERVER_INFO = struct.Struct("<256s4s4s")  # NatNet 2
# what a packet that is damaged, or of a kind the package does not know, raises
UNREADABLE = (NatNetError, struct.error, UnicodeDecodeError, ValueError, OverflowError)


class ServerInfo(NamedTuple):
    """version: NatNet's, two numbers; frequency [1/s]: of the clock, 0 if unknown."""

    application: str
    version: tuple[int, int]
    frequency: int
    data_port: int
    multicast: bool
    group: str


def request(message: int) -> bytes:
    content = b"Ping\0" if message == CONNECT else b"\0"
    return HEADER.pack(message, len(content)) + content


def read_server_info(content: bytes) -> ServerInfo:
    """Read the content of a SERVER_INFO packet; raises struct.error if it is too short."""
    if len(content) < _SERVER_INFO.size:
        name, _, version = _OLD_SERVER_INFO.unpack_from(content)
        return ServerInfo(_text(name), (version[0], version[1]), 0, 1511, True, "239.255.42.99")
    name, _, version, frequency, port, multicast, group = _SERVER_INFO.unpack_from(content)
    address = ".".join(map(str, group))
    return ServerInfo(_text(name), (version[0], version[1]), frequency, port, multicast, address)


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode(errors="replace")


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
