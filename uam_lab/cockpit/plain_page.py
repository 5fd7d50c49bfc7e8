"""The plain page: state and commands without the scene, for a phone or without WebGL.

The websocket server answers GET only. A command is therefore a GET with a header, which a page of
another origin cannot send, and with the secret of this page.
"""

from __future__ import annotations

import json
import secrets
from urllib.parse import parse_qs, urlsplit

from uam_lab.cockpit.commands import BUTTONS, GOAL, Commands, Later
from uam_lab.records.results import templates

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
        parts = urlsplit(target)
        if parts.path == ADDRESS:
            return 200, HTML, self.page("plain.html.j2").encode()
        if parts.path == STATE:
            return 200, JSON, self._state
        if parts.path not in (COMMAND, GOTO):
            return None
        if sent is None or not secrets.compare_digest(sent.encode(), self._secret.encode()):
            return 403, JSON, b'"not from this page"'
        (what,) = parse_qs(parts.query, keep_blank_values=True).get("is", [""])
        commands = self._commands
        if commands is None or (parts.path == COMMAND and what not in NAMES):
            return 404, JSON, b'"no such command"'
        if parts.path == GOTO:
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
