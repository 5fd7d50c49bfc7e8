"""Output of the mission at one tick, names of its phases, an operator's word on the magnet."""

from dataclasses import dataclass

import numpy as np

from uam_control.grasp import Grasp
from uam_control.supervision import State

# phases in addition to those of a scenario
WAITING, HOLD, LAND, LANDED, ABORTED = "waiting", "hold", "land", "landed", "aborted"
RELEASED, DRY_RUN, GOAL = "released", "dry run", "goal"
HAND_CHECK = "hand check"  # a person tilts the disarmed vehicle, see docs/preflight.md
TOUCHDOWN = "touchdown"  # a landing seeks the ground, see `ground.seek_ground`
PHASES = (WAITING, HOLD, LAND, TOUCHDOWN, LANDED, ABORTED, RELEASED, DRY_RUN, GOAL, HAND_CHECK)


@dataclass
class MissionOutput:
    """Output of the mission at one tick."""

    reference: np.ndarray  # (3, 6 + n), reused by the next step
    flying: bool = False  # position and attitude are controlled
    time: float = -1.0  # [s] since take-off, negative before
    phase: str = WAITING
    magnet: bool = False
    arm: bool = False  # desired arming of the autopilot
    regains: int = 0  # number of commands so far to regain a released vehicle
    done: bool = False
    abort_reason: str = ""  # why the scenario was aborted
    state: State = State.GROUNDED  # of the supervisor
    cause: str = ""  # of the state
    grasp: Grasp = Grasp.NONE
    attempt: int = 0  # number of the approach to the payload
    grasp_text: str = ""  # newest decision about the payload


class MagnetOverride:
    """An operator's word on the magnet, which counts until the scenario switches it next."""

    def __init__(self) -> None:
        self._given: tuple[bool, bool] | None = None  # overriding value, scenario's value then

    @property
    def given(self) -> bool:
        """Whether there is one."""
        return self._given is not None

    def give(self, on: bool, scenario: bool) -> None:
        """Override by `on`; scenario: its present value."""
        self._given = on, scenario

    def forget(self) -> None:
        """Override no more."""
        self._given = None

    def value(self, desired: bool) -> bool | None:
        """Return the overriding value, None for none; desired: the scenario's value now."""
        if self._given is None:
            return None
        on, before = self._given
        if desired != before:
            self._given = None
            return None
        return on
