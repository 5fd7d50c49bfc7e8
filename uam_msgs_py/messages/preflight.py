"""The pre-arm report in a diagnostic_msgs/DiagnosticArray: one status per check."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from uam_msgs_py.messages.ros_time import set_stamp
from uam_msgs_py.messages.status import ERROR, OK


class ReportedCheck(Protocol):
    """A line of the report, see `uam_control.supervision.PreflightCheck`."""

    name: str
    value: str
    limit: str
    passed: bool


def preflight_message(stamp: int, checks: Iterable[ReportedCheck]) -> DiagnosticArray:
    """Return the message; stamp [ns]."""
    array = DiagnosticArray(
        status=[
            DiagnosticStatus(
                level=OK if check.passed else ERROR,
                name=check.name,
                hardware_id="uam",
                message=check.value,
                values=[KeyValue(key="limit", value=check.limit)],
            )
            for check in checks
        ]
    )
    set_stamp(array.header.stamp, stamp)
    return array


def read_preflight(message: DiagnosticArray) -> Iterator[tuple[str, str, str, bool]]:
    """Yield name, value, limit and whether it passed, of each check."""
    for status in message.status:
        limit = {pair.key: pair.value for pair in status.values}.get("limit", "")
        yield status.name, status.message, limit, status.level == OK
