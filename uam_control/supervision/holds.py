"""Rules for the end of a hold without a command.

A hold beyond its limit becomes a landing after hold_timeout. After the limit is clear, when_clear
decides (after_restart for a lost controller). A quantity whose limit has been clear so
`resumes_allowed` times lands when it is exceeded again. Every other hold waits for a command, and
lands after wait_timeout, or after command_timeout if a command or a reached goal started it.
"""

import math
from collections import Counter
from collections.abc import Iterator

from uam_control.supervision.checks import CONTROLLERS
from uam_control.supervision.monitor import Level
from uam_control.supervision.states import Event
from uam_control.supervision.supervision_parameters import SupervisionParameters

BY_COMMAND = (Event.HOLD, Event.ARRIVED)


class Holds:
    """The present hold of a supervisor, and how many ended by themselves."""

    def __init__(self) -> None:
        self._since = math.inf  # stamp [s] at which the hold began; inf: no hold
        self._beyond_since: float | None = None  # stamp [s] from which a limit is exceeded
        self._quantity = ""  # name of the quantity whose limit started the hold
        self._event = Event.HOLD
        self._resumes: Counter[str] = Counter()  # quantity → holds that ended in CLEAR

    @property
    def lasts(self) -> bool:
        """Whether there is a hold now."""
        return self._since < math.inf

    def begin(self, stamp: float, event: Event, quantity: str) -> None:
        """Begin a hold at `stamp` [s]; quantity: name of the quantity beyond its limit, or ""."""
        self._since, self._event, self._quantity = stamp, event, quantity
        self._beyond_since = None

    def end(self, event: Event) -> None:
        """End the hold."""
        self._since, self._beyond_since = math.inf, None
        self._resumes[self._quantity] += event is Event.CLEAR

    def again(
        self, quantity: str, cause: str, p: SupervisionParameters
    ) -> Iterator[tuple[Event, str]]:
        """Yield a landing if `quantity`, whose hold limit is exceeded, has had all its resumes."""
        resumes = self._resumes[quantity]
        if 0 < resumes >= p.resumes_allowed:
            yield Event.EXCEEDED_AGAIN, f"{cause}, again after {resumes} resumes"

    def events(
        self, stamp: float, level: Level, beyond: str, cause: str, p: SupervisionParameters
    ) -> Iterator[tuple[Event, str]]:
        """Yield the events that end the hold at `stamp` [s], and their causes.

        level, beyond: of the worst exceeded limit now, and its cause; cause: of the hold.
        """
        if not self.lasts:
            return
        if level is Level.FINE:
            self._beyond_since = None
        elif self._beyond_since is None:
            self._beyond_since = stamp
        elif stamp - self._beyond_since >= p.hold_timeout:
            yield Event.HELD_TOO_LONG, f"{beyond} for {p.hold_timeout:g} s"
        longest = p.command_timeout if self._event in BY_COMMAND else p.wait_timeout
        if stamp - self._since >= longest:
            yield Event.WAITED_TOO_LONG, f"{cause}; no command for {longest:g} s"

    def clear(
        self, cause: str, off_path: bool, p: SupervisionParameters
    ) -> Iterator[tuple[Event, str]]:
        """Yield the event that ends the hold because its limit is clear; cause: of the hold.

        off_path: a goal or trajectory was flown; then the hold waits for a command.
        """
        if not self._quantity or not self.lasts:
            return
        if self._quantity == CONTROLLERS:
            back = "the controller is back"
            if p.after_restart == "land":
                yield Event.RESTARTED_TO_LAND, back
            elif p.after_restart == "go_on":
                yield Event.RESTARTED, back
        elif p.when_clear == "land":
            yield Event.CLEAR_TO_LAND, f"{cause}; clear again"
        elif p.when_clear == "resume" and not off_path:
            if p.resumes_allowed > self._resumes[self._quantity]:
                yield Event.CLEAR, "clear again"
            else:  # none is allowed
                yield Event.CLEAR_TO_LAND, f"{cause}; clear again"
