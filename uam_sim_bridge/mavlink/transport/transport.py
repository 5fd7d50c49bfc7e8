"""The interface `Transport` of MAVLink links, and `open_transport`, which opens one by URL.

The forms of a URL: docs/autopilot.md, Links. Without a local port the system chooses one.
"""

import ipaddress
from dataclasses import dataclass
from typing import Protocol

from uam_sim_bridge.mavlink.transport.stream_transport import (
    READ_LIMIT,
    SerialTransport,
    TcpTransport,
    resolve,
)
from uam_sim_bridge.ports import PortError, bound

LOOPBACK, EVERYWHERE = "127.0.0.1", "0.0.0.0"
ALLOWED = "udp:HOST:PORT[:LOCAL_PORT], tcp:HOST:PORT, serial:DEVICE:BAUD"
SLOWEST, FASTEST = 9600, 12_500_000  # baud


class Transport(Protocol):
    """A link that carries bytes."""

    stream: bool  # True: `receive` returns any chunks (TCP, serial); False: whole datagrams
    bytes_per_second: float | None  # of the line; None: unknown
    connected: bool  # whether the local end is open
    dropped: int  # frames that could not be sent

    def send(self, data: bytes) -> bool: ...

    def receive(self) -> list[bytes]: ...

    def fileno(self) -> int: ...

    def close(self) -> None: ...


class UdpTransport:
    """UDP between a local port and one peer; packets of other senders are ignored.

    The local port is bound to loopback if the peer is on this machine.
    """

    stream = False
    bytes_per_second = None
    connected = True

    def __init__(
        self, local_port: int, remote: tuple[str, int], read_limit: int = READ_LIMIT
    ) -> None:
        """local_port: 0 for any; remote: host, port; read_limit: bytes read per `receive`.

        Raises PortError in one line if the local port is in use or the host is unknown.
        """
        self._remote = (resolve(remote[0]), remote[1])
        self._read_limit = read_limit
        self.dropped = 0  # datagrams that could not be sent
        here = ipaddress.ip_address(self._remote[0]).is_loopback
        self._socket = bound("UDP", LOOPBACK if here else EVERYWHERE, local_port, "MAVLink")
        self._socket.setblocking(False)

    def send(self, data: bytes) -> bool:
        """Send one datagram; return whether it was sent. A failure is counted, not raised."""
        try:
            self._socket.sendto(data, self._remote)
        except OSError:
            self.dropped += 1
            return False
        return True

    def receive(self) -> list[bytes]:
        """Return the peer's datagrams; those of other senders count towards the limit as well."""
        datagrams, left = [], self._read_limit
        while left > 0:
            try:
                data, sender = self._socket.recvfrom(65535)
            except ConnectionError:  # the peer's port was closed at the last send
                left -= 1
                continue
            except OSError:  # no datagram, or no network
                break
            left -= max(1, len(data))
            if sender == self._remote:
                datagrams.append(data)
        return datagrams

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()


@dataclass(frozen=True)
class LinkUrl:
    """Parts of a link's URL."""

    kind: str  # udp, tcp or serial
    place: str  # host or device
    number: int  # port or baud rate
    local: int = 0  # local UDP port; 0: any

    @property
    def real(self) -> bool:
        """Whether a vehicle may be at the other end: a serial line, or another host."""
        return self.kind == "serial" or self.place not in ("localhost", "127.0.0.1", "::1")


def parse_url(url: str) -> LinkUrl:
    """Return the parts of `url`; raises PortError in one line for other than the table above."""
    kind, _, rest = url.partition(":")
    if kind == "serial":
        device, _, baud = rest.rpartition(":")  # a device's name may contain colons
        if not device or not _within(baud, SLOWEST, FASTEST):
            raise _bad(url, f"a device and {SLOWEST}..{FASTEST} baud expected")
        return LinkUrl(kind, device, int(baud))
    parts = rest.split(":")
    if kind not in ("udp", "tcp"):
        raise _bad(url, "unknown kind of link" if kind else "empty")
    if not parts[0] or len(parts) not in ((2, 3) if kind == "udp" else (2,)):
        raise _bad(url, "a host and a port expected")
    for port in parts[1:]:
        if not _within(port, 1, 65535):
            raise _bad(url, f"port {port} is not in 1..65535")
    return LinkUrl(kind, parts[0], *map(int, parts[1:]))


def open_transport(url: str, read_limit: int = READ_LIMIT, absent: bool = False) -> Transport:
    """Open the link of `url`.

    read_limit: bytes read per `receive` of a UDP link; absent: a serial device may be plugged in
    later. Raises PortError in one line if the URL has no such form or cannot be opened.
    """
    link = parse_url(url)
    if link.kind == "serial":
        return SerialTransport(link.place, link.number, absent=absent)
    if link.kind == "tcp":
        return TcpTransport((link.place, link.number))
    return UdpTransport(link.local, (link.place, link.number), read_limit)


def _within(text: str, low: int, high: int) -> bool:
    return text.isascii() and text.isdecimal() and len(text) < 10 and low <= int(text) <= high


def _bad(url: str, why: str) -> PortError:
    return PortError(f"link {url!r}: {why}; allowed: {ALLOWED}")
