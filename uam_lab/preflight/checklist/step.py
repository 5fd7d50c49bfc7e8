"""One step of the guided list: what a person does, and its findings."""

from dataclasses import dataclass
from enum import Enum

from uam_control.settings.preflight_check import GUIDED, PreflightCheck
from uam_lab.preflight.checklist.observation import Sample

MOTION, CONFIRM = "motion", "confirm"  # what a step needs
UNKNOWN = "unknown"


def at_most(
    name: str, value: float | None, limit: float, unit: str, standing: bool = False
) -> PreflightCheck:
    """Return the check of a value with an upper limit; None: it is not known, not passed."""
    passed = value is not None and value <= limit
    return PreflightCheck(
        name, _shown(value, unit), f"at most {_shown(limit, unit)}", passed, standing
    )


def at_least(name: str, value: float | None, limit: float, unit: str) -> PreflightCheck:
    """Return the check of a value with a lower limit; None: it is not known, not passed."""
    passed = value is not None and value >= limit
    return PreflightCheck(name, _shown(value, unit), f"at least {_shown(limit, unit)}", passed)


def _shown(value: float | None, unit: str) -> str:
    return UNKNOWN if value is None else f"{value:.3g} {unit}".strip()


class StepState(Enum):
    """State of a step; a FAILED one is tried again."""

    OPEN = "open"
    ACTIVE = "active"
    PASSED = "passed"
    FAILED = "failed"


@dataclass(frozen=True)
class Situation:
    """What the steps look at, at `time` [s]."""

    time: float
    sample: Sample | None = None  # None until all sensors have sent
    magnet: bool | None = None  # state that its driver reports, None without one
    killed: bool | None = None  # whether the kill switch is engaged, None if not known


class Step:
    """Base of all steps.

    name: machine-readable; needs: MOTION, CONFIRM or "" (nothing but time); seen: what is seen now;
    tries: how often the step was begun.
    """

    commands = False  # the mission computes body rates meanwhile
    arm_released = False  # the servos have no torque
    magnet: bool | None = None  # how it shall be switched, None for as it is

    def __init__(self, name: str, instruction: str, limit: str, needs: str) -> None:
        self.name, self._instruction, self.limit, self.needs = name, instruction, limit, needs
        self.state, self.value, self.seen = StepState.OPEN, "", ""
        self.tries, self.confirmed = 0, False
        self.ended: float | None = None  # [s]

    @property
    def instruction(self) -> str:
        """Return what the person does now."""
        return self._instruction

    @property
    def item(self) -> PreflightCheck:
        """Return the result, or what is seen now."""
        passed = {StepState.PASSED: True, StepState.FAILED: False}.get(self.state)
        time = "" if self.ended is None else f"{self.ended:.3f}"
        value = self.value or self.seen
        return PreflightCheck(
            self.name, value, self.limit, passed, False, GUIDED, time, self.confirmed
        )

    def begin(self, time: float) -> None:
        """Begin the step, or begin it again, at `time` [s]."""
        self.state, self.tries, self.confirmed = StepState.ACTIVE, self.tries + 1, False
        self.value, self.seen, self.ended = "", "", None

    def update(self, now: Situation) -> None:
        """Judge what is seen now; called only for an active or failed step."""

    def confirm(self, time: float) -> str:
        """Take the person's confirmation; return why it does not count, "" if it does."""
        if self.needs != CONFIRM:
            return f"{self.name} passes by what the sensors see, not by a confirmation"
        self.confirmed = True
        self._pass(time, "confirmed by the person")
        return ""

    def _pass(self, time: float, value: str) -> None:
        self.state, self.value, self.ended = StepState.PASSED, value, time

    def _fail(self, time: float, value: str) -> None:
        self.state, self.value, self.ended = StepState.FAILED, value, time
