"""The server of the page: address, port and allowed origins."""

from __future__ import annotations

import contextlib
import functools
import io
import re
import socket
from collections.abc import Iterator, Sequence

import viser
import websockets.asyncio.server

from uam_lab.cockpit.page_address import LOCAL, address, free_port


def serve(host: str, port: int, label: str, origins: Sequence[str] = ()) -> viser.ViserServer:
    """Serve on `host`, at the first free port from `port` on, 0 for any.

    Pages of other origins may not connect: only those of this host, and `origins` (as
    "http://name:port"). Raises AddressError.
    """
    found = free_port(host, port)
    allowed = [*_own_origins(host, found), *origins, None]  # None: no browser
    with _origins(allowed), contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=found, label=label, verbose=False)
    return server


def url(server: viser.ViserServer) -> str:
    """Return the URL of the page for a browser on this machine."""
    return address(server.get_host(), server.get_port())


def _own_origins(host: str, port: int) -> list[str | re.Pattern[str]]:
    names = {"localhost", LOCAL, host}
    if host not in ("localhost", LOCAL):  # reachable from other computers, by these names
        names |= {socket.gethostname(), socket.getfqdn()}
        with contextlib.suppress(OSError):
            names |= set(socket.gethostbyname_ex(socket.gethostname())[2])
    return [re.compile(rf"https?://({'|'.join(map(re.escape, sorted(names)))}):{port}")]


@contextlib.contextmanager
def _origins(allowed: Sequence[str | re.Pattern[str] | None]) -> Iterator[None]:
    """Set the allowed origins in websockets, as viser has no option for them."""
    plain = websockets.asyncio.server.serve
    websockets.asyncio.server.serve = functools.partial(plain, origins=list(allowed))
    try:
        yield
    finally:
        websockets.asyncio.server.serve = plain
