"""MAVLink over UDP: one or several messages per datagram, one peer."""

import ipaddress
import socket

from uam_sim_bridge.ports import PortError, bound

LOOPBACK, EVERYWHERE = "127.0.0.1", "0.0.0.0"
READ_LIMIT = 1 << 20  # bytes per call: more than a tick's traffic; bounds the time of a call


def resolve(host: str) -> str:
    """Return the IPv4 address of a host name; raises PortError in one line if there is none."""
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise PortError(f"host {host}: {reason}") from None


class UdpTransport:
    """UDP between a local port and one peer; packets of other senders are ignored.

    The local port is bound to loopback if the peer is on this machine. `dropped`: datagrams that
    could not be sent.
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
        self.dropped = 0
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
        """Return the socket's file descriptor, for select."""
        return self._socket.fileno()

    def close(self) -> None:
        """Release the port."""
        self._socket.close()
