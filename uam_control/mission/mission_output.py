"""Output of the mission at one tick, and the names of its phases."""

from dataclasses import dataclass

import numpy as np

from uam_control.grasp import Grasp
from uam_control.supervision import State

# phases in addition to those of a scenario
WAITING, HOLD, LAND, LANDED, ABORTED = "waiting", "hold", "land", "landed", "aborted"
RELEASED, DRY_RUN, GOAL = "released", "dry run", "goal"
HAND_CHECK = "hand check"  # a person tilts the disarmed vehicle, see docs/preflight.md
PHASES = (WAITING, HOLD, LAND, LANDED, ABORTED, RELEASED, DRY_RUN, GOAL, HAND_CHECK)


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
