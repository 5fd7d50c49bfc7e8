"""Errors of the library; the text of each is one line: what happened, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from uam_lab.library.flight_result import FlightResult


class FlightError(RuntimeError):
    """A flight cannot do what was requested."""


class FlightFailed(FlightError):
    """A technical failure ended the flight, for instance the loss of a node.

    result: of the flight up to then.
    """

    def __init__(self, reason: str, result: FlightResult) -> None:
        super().__init__(reason)
        self.result = result


class FlightEnded(FlightError):
    """The flight has ended without what was waited for."""


class NotInTime(FlightError, TimeoutError):
    """The flight did not do in time what was waited for."""


class CommandRefused(FlightError):
    """The flight refused a command or a parameter; the text is the reason."""
