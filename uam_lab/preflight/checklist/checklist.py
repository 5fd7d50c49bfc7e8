"""The whole checklist: automatic items, then guided steps, then the permission to start.

The guided steps begin when all automatic items pass. Items that need a standing vehicle are not
judged while it is in the hands of a person; after the last step they must pass again. All items
together give the permission; it is taken back when an automatic item fails, and comes back with it.
Nothing changes while the vehicle is armed.
"""

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

from uam_control.settings.preflight_check import AUTOMATIC, GUIDED, PreflightCheck
from uam_lab.flights.vehicle.checklist_parameters import ChecklistParameters
from uam_lab.preflight.checklist.step import Situation, Step, StepState


class Checklist:
    """The automatic items and the guided ones, with a record of them."""

    def __init__(self, steps: Sequence[Step]) -> None:
        self.steps = list(steps)  # of the guided items
        self.findings: tuple[PreflightCheck, ...] = ()  # of the automatic items
        self.entries: list[dict[str, Any]] = []  # changes of items, with time [s] of the stamps
        self._time = 0.0
        self._armed = False
        self._noted: dict[str, tuple[str, str]] = {}

    @property
    def step(self) -> Step | None:
        """Return the step that is done now, None before the first and after the last one."""
        return next(
            (one for one in self.steps if one.state in (StepState.ACTIVE, StepState.FAILED)), None
        )

    @property
    def failing_names(self) -> list[str]:
        """Return the names of the items that have not passed."""
        found = [one.name for one in self.findings if not one.passed]
        found += [] if self.findings else ["automatic items"]
        return found + [one.name for one in self.steps if one.state is not StepState.PASSED]

    @property
    def passed(self) -> bool:
        return not self.failing_names

    @property
    def items(self) -> list[PreflightCheck]:
        """Return all items as they are now."""
        automatic = (one._replace(kind=AUTOMATIC) for one in self.findings)
        return [*automatic, *(step.item for step in self.steps)]

    def update(self, now: Situation, findings: Iterable[PreflightCheck], armed: bool) -> None:
        """Judge what is seen at `now`; findings: of the automatic items."""
        self._time, self._armed = now.time, armed
        if armed:
            return
        self._take(tuple(findings))
        step = self.step
        if step is None:
            self._begin_next(now.time)
        else:
            step.update(now)
            self._note_step(step)
            if step.state is StepState.PASSED:
                self._begin_next(now.time)

    def _take(self, findings: tuple[PreflightCheck, ...]) -> None:
        if self.step is not None:  # the vehicle is in the hands of a person
            before = {one.name: one for one in self.findings}
            findings = tuple(before.get(one.name, one) if one.standing else one for one in findings)
        self.findings = findings
        for one in findings:
            state = StepState.PASSED if one.passed else StepState.FAILED
            self._note(AUTOMATIC, one, state)

    def _begin_next(self, time: float) -> None:
        """Begin the next open step; the first one only when all automatic items pass."""
        upcoming = next((one for one in self.steps if one.state is StepState.OPEN), None)
        if upcoming is None:
            return
        if upcoming is self.steps[0] and not all(one.passed for one in self.findings):
            return
        upcoming.begin(time)
        self._note_step(upcoming)

    def confirm(self) -> tuple[bool, str]:
        """Confirm the present step; return whether it counts, and why or why not in one line."""
        step = self.step
        if self._armed:
            return False, "refused: the vehicle is armed"
        if step is None:
            return False, f"refused: no step is waiting{self._why_not()}"
        refusal = step.confirm(self._time)
        if refusal:
            return False, f"refused: {refusal}"
        self._note_step(step)
        self._begin_next(self._time)
        return True, f"{step.name} confirmed"

    def repeat(self) -> tuple[bool, str]:
        """Begin the present step again, or the last one that has passed; returns as `confirm`."""
        if self._armed:
            return False, "refused: the vehicle is armed"
        step = self.step
        if step is None:
            done = [one for one in self.steps if one.state is StepState.PASSED]
            if not done:
                return False, f"refused: no step has begun{self._why_not()}"
            step = done[-1]
        step.begin(self._time)
        self._note_step(step)
        return True, f"{step.name} begins again"

    def _why_not(self) -> str:
        names = ", ".join(self.failing_names)
        return f"; open: {names}" if names else ", all items have passed"

    def _note_step(self, step: Step) -> None:
        self._note(GUIDED, step, step.state, step.confirmed, step.tries)

    def _note(
        self,
        kind: str,
        one: PreflightCheck | Step,
        state: StepState,
        confirmed: bool = False,
        tries: int = 0,
    ) -> None:
        """Add an entry if the state of an item has changed, or the result of a step.

        The value of an automatic item changes all the time and is no event.
        """
        value = one.value or "open"
        now = state.value, value if kind == GUIDED else ""
        if self._noted.get(one.name) == now:
            return
        self._noted[one.name] = now
        entry = {"time": self._time, "kind": kind, "name": one.name, "state": state.value}
        entry |= {"value": value, "limit": one.limit}
        self.entries.append(entry | {"confirmed": confirmed, "tries": tries})


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
    events = [one | {"time": moment(one["time"])} for one in checklist.entries]
    return {
        "passed": checklist.passed,
        "failing": checklist.failing_names,
        "items": items,
        "limits": limits.to_mapping(),
        "events": events,
    }
