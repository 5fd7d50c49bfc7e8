"""Checklist and pre-arm report, each in a diagnostic_msgs/DiagnosticArray.

A checklist has its state, then one status per item, a report one status per check.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from uam_msgs_py.messages.status import (
    ERROR,
    OK,
    STALE,
    ChecklistState,
    diagnostics,
    status_of,
    texts_of,
)

PASSED, FAILED, OPEN = "passed", "failed", "open"
LEVELS = {PASSED: OK, FAILED: ERROR, OPEN: STALE}


@dataclass(frozen=True)
class ChecklistItem:
    """An item of a checklist."""

    name: str
    kind: str  # "automatic" or "guided"
    result: str  # PASSED, FAILED or OPEN
    value: str
    limit: str
    time: str = ""  # [s] of the result, by stamps, "" without one
    confirmed: bool = False  # by the person


def checklist_message(
    stamp: int, state: ChecklistState, items: Iterable[ChecklistItem]
) -> DiagnosticArray:
    """Return the message; stamp [ns]."""
    message = state.to_message(stamp)
    message.status = [*message.status, *map(_status, items)]
    return message


def _status(item: ChecklistItem) -> DiagnosticStatus:
    values = {
        "kind": item.kind,
        "limit": item.limit,
        "passed": item.result == PASSED,
        "time": item.time,
        "confirmed": item.confirmed,
    }
    return status_of(item.name, LEVELS.get(item.result, STALE), item.value, values)


def read_items(message: DiagnosticArray) -> list[ChecklistItem]:
    """Return the items of a message."""
    results = {level: result for result, level in LEVELS.items()}
    found = []
    for status in message.status:
        if status.name == ChecklistState.NAME:
            continue
        texts = texts_of(status)
        found.append(
            ChecklistItem(
                status.name,
                texts.get("kind", ""),
                results.get(status.level, OPEN),
                status.message,
                texts.get("limit", ""),
                texts.get("time", ""),
                texts.get("confirmed") == "True",
            )
        )
    return found


class ReportedCheck(Protocol):
    """A line of the report, see `uam_control.supervision.PreflightCheck`."""

    name: str
    value: str
    limit: str
    passed: bool


def preflight_message(stamp: int, checks: Iterable[ReportedCheck]) -> DiagnosticArray:
    """Return the message; stamp [ns]."""
    levels = {True: OK, False: ERROR}
    return diagnostics(
        stamp,
        [
            status_of(one.name, levels[one.passed], one.value, {"limit": one.limit})
            for one in checks
        ],
    )


def read_preflight(message: DiagnosticArray) -> Iterator[tuple[str, str, str, bool]]:
    """Yield name, value, limit and whether it passed, of each check."""
    for status in message.status:
        yield status.name, status.message, texts_of(status).get("limit", ""), status.level == OK
