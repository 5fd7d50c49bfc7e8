"""NatNet's packets: requests of a client, and the answer to the first one.

The package `natnet` reads frames and model definitions. Its own client is not used: it sends a
keep-alive for each packet, a damaged packet ends its receiving thread, and it does not read the
frequency of the server's clock, without which the stamps have no unit.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

CONNECT, SERVER_INFO = 0, 1
REQUEST_MODEL_DEFINITIONS, MODEL_DEFINITIONS, FRAME = 4, 5, 7
KEEP_ALIVE = 10
HEADER = struct.Struct("<HH")  # message, bytes that follow
# application, its version, NatNet's version, clock [ticks/s], data port, multicast, group
_SERVER_INFO = struct.Struct("<256s4s4sQH?4s")
_OLD_SERVER_INFO = struct.Struct("<256s4s4s")  # NatNet 2


class ServerInfo(NamedTuple):
    """version: NatNet's, two numbers; frequency [1/s]: of the clock, 0 if unknown."""

    application: str
    version: tuple[int, int]
    frequency: int
    data_port: int
    multicast: bool
    group: str


def request(message: int) -> bytes:
    """Return the packet of a request."""
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
