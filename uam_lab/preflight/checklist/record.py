"""The record of a checklist: a JSON file in the result folder."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from uam_lab.preflight.checklist.checklist import AUTOMATIC, GUIDED, Checklist
from uam_lab.preflight.checklist.limits import ChecklistParameters
from uam_lab.preflight.checklist.step import StepState


def record(
    checklist: Checklist, limits: ChecklistParameters, clock_offset: float
) -> dict[str, Any]:
    """Return the record; clock_offset [s]: what makes UTC out of a stamp.

    `items`: the newest result of each, `events`: every change in order.
    """

    def moment(stamp: float | None) -> str | None:
        if stamp is None:
            return None
        return datetime.fromtimestamp(stamp + clock_offset, UTC).isoformat(timespec="milliseconds")

    items = [
        {"kind": AUTOMATIC, "name": one.name, "passed": one.passed, "value": one.value,
         "limit": one.limit}
        for one in checklist.findings
    ]  # fmt: skip
    for one in checklist.steps:
        items.append(
            {"kind": GUIDED, "name": one.name, "passed": one.state is StepState.PASSED,
             "value": one.value, "limit": one.limit, "time": moment(one.ended),
             "confirmed_by_person": one.confirmed, "tries": one.tries}
        )  # fmt: skip
    events = [asdict(one) | {"time": moment(one.time)} for one in checklist.entries]
    return {
        "passed": checklist.passed,
        "failing": checklist.failing_names,
        "items": items,
        "limits": limits.to_mapping(),
        "events": events,
    }
