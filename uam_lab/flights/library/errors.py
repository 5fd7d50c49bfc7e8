"""Errors of the library; the text of each is one line: what happened, and why."""


class FlightError(RuntimeError):
    """A flight cannot do what was requested."""


class FlightEnded(FlightError):
    """The flight has ended without what was waited for."""


class NotInTime(FlightError, TimeoutError):
    """The flight did not do in time what was waited for."""


class CommandRefused(FlightError):
    """The flight refused a command or a parameter; the text is the reason."""
