"""MAVLink over UDP: one message or several per datagram, one peer."""

from __future__ import annotations

import ipaddress
import socket

from uam_sim_bridge.ports import PortError

LOOPBACK, EVERYWHERE = "127.0.0.1", "0.0.0.0"
READ_LIMIT = 1 << 20  # bytes per call: far more than any tick brings, yet an end to a flood


def resolve(host: str) -> str:
    """Return the IPv4 address of a host name; raises PortError in one line where it has none."""
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise PortError(f"host {host}: {reason}") from None


class UdpTransport:
    """UDP between a local port and the peer's; packets from elsewhere are ignored.

    Open to the network only where the peer is not on this machine. `dropped`: datagrams that the
    system did not take.
    """

    stream = False
    bytes_per_second = None
    connected = True

    def __init__(
        self, local_port: int, remote: tuple[str, int], read_limit: int = READ_LIMIT
    ) -> None:
        """local_port: 0 for any; read_limit: bytes taken per `receive`, the rest waits.

        Raises PortError in one line where the local port is taken or the host unknown.
        """
        self._remote = (resolve(remote[0]), remote[1])
        self._read_limit = read_limit
        self.dropped = 0
        here = ipaddress.ip_address(self._remote[0]).is_loopback
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((LOOPBACK if here else EVERYWHERE, local_port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            reason = getattr(error, "strerror", None) or str(error)
            raise PortError(
                f"UDP port {local_port} for MAVLink: {reason}; stop the program that "
                "uses it or choose another instance"
            ) from None
        self._socket.setblocking(False)

    def send(self, data: bytes) -> bool:
        """Send one datagram; whether it went. Nobody listening or no network is no error."""
        try:
            self._socket.sendto(data, self._remote)
        except OSError:
            self.dropped += 1
            return False
        return True

    def receive(self) -> list[bytes]:
        """Return the datagrams that have arrived; those of strangers count for the limit too."""
        datagrams, left = [], self._read_limit
        while left > 0:
            try:
                data, sender = self._socket.recvfrom(65535)
            except ConnectionError:  # our last datagram found nobody
                left -= 1
                continue
            except OSError:  # nothing there, or the network is gone
                break
            left -= max(1, len(data))
            if sender == self._remote:
                datagrams.append(data)
        return datagrams

    def fileno(self) -> int:
        """Return the socket's number, for select."""
        return self._socket.fileno()

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()
