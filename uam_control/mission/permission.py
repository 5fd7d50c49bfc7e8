"""The permission of the checklist to start a flight, see docs/preflight.md."""

from __future__ import annotations

from dataclasses import dataclass

from uam_control.supervision import PreflightCheck

OLDEST = 3.0  # [s] age of a report that still counts; it comes several times a second


@dataclass(frozen=True)
class ChecklistReport:
    """Newest state of the checklist, of `stamp` [s].

    failing: names of the items that have not passed; commands: a person tilts the vehicle and looks
    at the commanded body rates.
    """

    stamp: float
    passed: bool
    failing: str = ""
    commands: bool = False


class Permission:
    """Permission to start; where it is not required, it is always there."""

    NAME = "checklist"

    def __init__(self, required: bool) -> None:
        self._required = required
        self._report: ChecklistReport | None = None

    def take(self, report: ChecklistReport | None) -> None:
        """Take a report; None forgets the last one."""
        self._report = report

    def lines(self, now: float) -> tuple[PreflightCheck, ...]:
        """Return its line of the pre-arm report at `now` [s], () where it is not required."""
        if not self._required:
            return ()
        value, report = "passed", self._report
        if report is None:
            value = "no report"
        elif self._old(now):
            value = f"silent for {now - report.stamp:.0f} s"
        elif not report.passed:
            value = report.failing or "not passed"
        return (PreflightCheck(self.NAME, value, "all items passed", value == "passed"),)

    def refusal(self, now: float) -> str:
        """Return why there is no permission at `now` [s], in one line; "" if there is."""
        return "".join(line.text for line in self.lines(now) if not line.passed)

    def commands(self, now: float) -> bool:
        """Return whether body rates are to be computed for a vehicle in the hands of a person."""
        report = self._report
        return self._required and report is not None and report.commands and not self._old(now)

    def _old(self, now: float) -> bool:
        return abs(now - self._report.stamp) > OLDEST
