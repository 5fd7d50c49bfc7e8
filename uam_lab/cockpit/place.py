"""Where the page is: address and port."""

from __future__ import annotations

import errno
import socket

LOCAL = "127.0.0.1"
PORT = 8080
TRIES = 100  # ports looked at from the one wished for


class PlaceError(OSError):
    """The page cannot be served there; the message says why."""


def address(host: str, port: int) -> str:
    """The same, before it is served."""
    return f"http://{'localhost' if host in (LOCAL, '0.0.0.0') else host}:{port}"


def free_port(host: str, port: int) -> int:
    """The first free port of TRIES from `port` on, any for 0. Raises PlaceError."""
    for number in range(port, min(port + TRIES, 65536)) if port else (0,):
        try:
            with socket.create_server((host, number)) as probe:
                return probe.getsockname()[1]
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise PlaceError(f"cannot serve on {host}: {error.strerror}") from None
    raise PlaceError(f"cannot serve on {host}: ports {port} to {number} are in use")
