"""Address and port of the page."""

import errno
import socket

LOCAL = "127.0.0.1"
PORT = 8080
TRIES = 100  # number of ports to try


class AddressError(OSError):
    """The page cannot be served at this address; the text gives the reason."""


def address(host: str, port: int) -> str:
    """Return the URL of a page at `host` and `port`."""
    return f"http://{'localhost' if host in (LOCAL, '0.0.0.0') else host}:{port}"


def free_port(host: str, port: int, step: int = 1) -> int:
    """Return the first free port of TRIES: `port`, then each `step` above it; any for 0.

    Raises AddressError.
    """
    tried = range(port, min(port + TRIES * step, 65536), step) if port else (0,)
    for number in tried:
        try:
            with socket.create_server((host, number)) as probe:
                return probe.getsockname()[1]
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise AddressError(f"cannot serve on {host}: {error.strerror}") from None
    raise AddressError(f"cannot serve on {host}: ports {port} to {number} are in use")
