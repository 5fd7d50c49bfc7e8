"""One line of a report before the flight: of the pre-arm report, and of a vehicle's checklist."""

from typing import NamedTuple

AUTOMATIC, GUIDED = "automatic", "guided"  # kinds of the checklist's items


class PreflightCheck(NamedTuple):
    """A quantity beside its limit, with their units. The last four are of a checklist."""

    name: str
    value: str
    limit: str
    passed: bool | None  # None: a guided item that is still to be done
    standing: bool = False  # judged only while nobody moves the vehicle
    kind: str = ""  # AUTOMATIC or GUIDED
    time: str = ""  # [s] of the result, by stamps, "" without one
    confirmed: bool = False  # by the person

    @property
    def text(self) -> str:
        """The check in one line."""
        return f"{self.name}: {self.value} ({self.limit})"
