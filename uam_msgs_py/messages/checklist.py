"""Checklist and pre-arm report, each in a diagnostic_msgs/DiagnosticArray.

A checklist has its state, then one status per item, a report one status per check.
"""

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from uam_control.settings.preflight_check import PreflightCheck
from uam_msgs_py.messages.status import (
    ERROR,
    OK,
    STALE,
    ChecklistState,
    diagnostics,
    status_of,
    texts_of,
)

LEVELS = {True: OK, False: ERROR, None: STALE}
LIMIT = "limit"  # in every line, not in the state of a checklist


def checklist_message(
    stamp: int, state: ChecklistState, items: Iterable[PreflightCheck]
) -> DiagnosticArray:
    """Return the message; stamp [ns]."""
    message = state.to_message(stamp)
    message.status = [*message.status, *map(_status, items)]
    return message


def preflight_message(stamp: int, checks: Iterable[PreflightCheck]) -> DiagnosticArray:
    """Return the message; stamp [ns]."""
    return diagnostics(stamp, map(_status, checks))


def _status(one: PreflightCheck) -> DiagnosticStatus:
    values = {LIMIT: one.limit}
    if one.kind:
        result = {"passed": one.passed is True, "time": one.time, "confirmed": one.confirmed}
        values = {"kind": one.kind} | values | result
    return status_of(one.name, LEVELS[one.passed], one.value, values)


def read_checks(message: DiagnosticArray) -> list[PreflightCheck]:
    """Return the items of a checklist, or the lines of a report."""
    results = {level: passed for passed, level in LEVELS.items()}
    texts = [(status, texts_of(status)) for status in message.status]
    return [
        PreflightCheck(
            status.name,
            status.message,
            own[LIMIT],
            results.get(status.level),
            kind=own.get("kind", ""),
            time=own.get("time", ""),
            confirmed=own.get("confirmed") == "True",
        )
        for status, own in texts
        if LIMIT in own
    ]
