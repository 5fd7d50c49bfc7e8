"""The server of the pages: address, port, allowed origins, and what a page may load.

The websocket server answers GET only. A command is therefore a GET with a header, which a page of
another origin cannot send, and with the secret of this page.
"""

import contextlib
import functools
import io
import json
import re
import secrets
import socket
from collections.abc import Callable, Iterator, Sequence
from typing import Any
from urllib.parse import parse_qs

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from uam_lab.cockpit.commands import BUTTONS, GOAL, Commands, Later
from uam_lab.cockpit.page_address import LOCAL, address, free_port
from uam_lab.records.results import templates

# "{nonce}": new for each answer; styles in elements are those of viser and of the headline.
# {decoder}: viser compiles the decoder of its messages; it may, a script from a text may not.
POLICY = (
    "default-src 'none'; script-src 'nonce-{nonce}' 'wasm-unsafe-eval' blob:{decoder}; "
    "worker-src blob:; "
    "style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' ws://{host} wss://{host} data: blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
Origin = str | re.Pattern[str]
Handler = Callable[[ServerConnection, Request], Response | None]
ADDRESS, STATE, COMMAND, GOTO = "/control", "/state", "/command", "/goto"
NARROWEST = 700  # [px] of a window that shows the scene between the panels
ANYWAY = "?scene"  # of the address: the scene in a narrower one, too
HEADER = "X-Uam-Command"  # of a command; its value is the secret
HTML, JSON = "text/html; charset=utf-8", "application/json"
NAMES = {button.label: button for button in BUTTONS}


class PlainPage:
    """Answers requests in the server's thread; `show` is called in that of the cockpit."""

    def __init__(self, later: Later, results: str = "") -> None:
        """later: passes a command to the cockpit's thread; results: folder of the flight."""
        self._later, self._results = later, results
        self._secret = secrets.token_urlsafe()
        self._server = secrets.token_urlsafe(4)  # another one: the page loads itself anew
        self._state = json.dumps({"server": self._server}).encode()
        self._commands: Commands | None = None

    def show(self, headline: str, lines: list[str], over: bool, commands: Commands) -> None:
        """Take the present state. headline: HTML; lines: newest answers; over: flight is over."""
        self._commands = commands
        refusals = {label: commands.refusal(button) for label, button in NAMES.items()}
        questions = {label: commands.question(button) for label, button in NAMES.items()}
        state = {
            "server": self._server,
            "headline": headline,
            "lines": lines,
            "over": over,
            "refusals": refusals,
            "questions": questions,
        }
        self._state = json.dumps(state).encode()

    def answer(self, target: str, sent: str | None) -> tuple[int, str, bytes] | None:
        """Return status, content type and body for a request; None: not of this page.

        sent: content of HEADER.
        """
        path, _, query = target.partition("?")
        if path == ADDRESS:
            return 200, HTML, self.page("plain.html.j2").encode()
        if path == STATE:
            return 200, JSON, self._state
        if path not in (COMMAND, GOTO):
            return None
        if sent is None or not secrets.compare_digest(ascii(sent), ascii(self._secret)):
            return 403, JSON, b'"not from this page"'
        what = parse_qs(query, keep_blank_values=True).get("is", [""])[-1]
        commands = self._commands
        if commands is None or (path == COMMAND and what not in NAMES):
            return 404, JSON, b'"no such command"'
        if path == GOTO:
            self._later(lambda: commands.goto(what))
        else:
            self._later(lambda: commands.call(NAMES[what]))
        return 200, JSON, b'"sent"'

    def page(self, template: str, nonce: str = "@NONCE@") -> str:
        """Return a page or its part; the server puts in the nonce of its scripts."""
        return templates.render(
            "uam_lab.cockpit",
            template,
            nonce=nonce,
            secret=self._secret,
            header=HEADER,
            buttons=BUTTONS,
            goal=GOAL,
            results=self._results,
            control=ADDRESS,
            narrowest=NARROWEST,
            anyway=ANYWAY,
        )


def serve(
    host: str, port: int, label: str, plain: PlainPage, origins: Sequence[str] = ()
) -> viser.ViserServer:
    """Serve on `host`, at the first free port from `port` on, 0 for any; plain: the plain page.

    Pages of other origins may not connect: only those of this host, and `origins` (as
    "http://name:port"). Raises AddressError.
    """
    found = free_port(host, port)
    allowed = [*_own_origins(host, found), *origins]
    with _guarded(allowed, plain), contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=found, label=label, verbose=False)
    return server


def url(server: viser.ViserServer) -> str:
    """Return the URL of the page for a browser on this machine."""
    return address(server.get_host(), server.get_port())


def _own_origins(host: str, port: int) -> list[Origin]:
    names = {"localhost", LOCAL, host}
    if host not in ("localhost", LOCAL):  # reachable from other computers, by these names
        names |= {socket.gethostname(), socket.getfqdn()}
        with contextlib.suppress(OSError):
            names |= set(socket.gethostbyname_ex(socket.gethostname())[2])
    return [re.compile(rf"https?://({'|'.join(map(re.escape, sorted(names)))}):{port}")]


@contextlib.contextmanager
def _guarded(allowed: Sequence[Origin], plain: PlainPage) -> Iterator[None]:
    """Set origins and answers in websockets, as viser has no option for them."""
    original = websockets.asyncio.server.serve

    def guarded(*given: Any, process_request: Handler, **how: Any) -> Any:
        handler = functools.partial(_answer, process_request, allowed, plain)
        everyone = [*allowed, None]  # None: no browser
        return original(*given, process_request=handler, origins=everyone, **how)

    websockets.asyncio.server.serve = guarded
    try:
        yield
    finally:
        websockets.asyncio.server.serve = original


def _answer(
    viser_answer: Handler,
    allowed: Sequence[Origin],
    plain: PlainPage,
    connection: ServerConnection,
    request: Request,
) -> Response | None:
    """Answer a request; None for a websocket, whose origin the library checks."""
    host = request.headers.get("Host", "")
    own = f"http://{host}"
    fits = (one == own if isinstance(one, str) else one.fullmatch(own) for one in allowed)
    if not any(fits):  # a foreign name of this address
        return _response(connection, 403, "text/plain", b"not the name of this page\n", host)
    if request.headers.get("Upgrade") == "websocket":
        return None
    found = plain.answer(request.path, request.headers.get(HEADER))
    if found is not None:
        return _response(connection, *found, host)
    if "Accept-Encoding" in request.headers:  # the text is changed below
        del request.headers["Accept-Encoding"]
    page = viser_answer(connection, request)
    kind = page.headers.get("Content-Type", "text/plain")
    body = page.body or b""
    if page.status_code == 200 and kind.startswith("text/html"):
        # before the page's own script; the name of the nonce is replaced with it
        begin, end = (plain.page(part).encode() for part in ("scene.html.j2", "watching.html.j2"))
        body = body.replace(b"<script ", begin + b'<script nonce="@NONCE@" ', 1)
        body = body.replace(b"</body>", end + b"</body>")
    return _response(connection, page.status_code, kind, body, host, " 'unsafe-eval'")


def _response(
    connection: ServerConnection, status: int, kind: str, body: bytes, host: str, decoder: str = ""
) -> Response:
    """Return the answer, with what the page may load, and that no other page may frame it."""
    nonce = secrets.token_urlsafe(16)
    if kind.startswith("text/html"):
        body = body.replace(b"@NONCE@", nonce.encode())
    made = connection.respond(status, "")
    made.headers = Headers(
        [
            ("Content-Type", kind),
            ("Content-Length", str(len(body))),
            ("Connection", "close"),
            ("Cache-Control", "no-store"),
            ("Content-Security-Policy", POLICY.format(nonce=nonce, host=host, decoder=decoder)),
            ("X-Frame-Options", "DENY"),
            ("X-Content-Type-Options", "nosniff"),
            ("Referrer-Policy", "no-referrer"),
        ]
    )
    made.body = body
    return made
