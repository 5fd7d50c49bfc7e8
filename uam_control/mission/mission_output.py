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
    """Output of the mission at one tick.

    reference (3, 6 + n), reused by the next step; flying: position and attitude are controlled;
    time [s]: since take-off, negative before; arm: desired arming of the autopilot; regains: number
    of commands so far to regain a released vehicle; state, cause: of the supervisor; abort_reason:
    why the scenario was aborted, "" if not. grasp: state of the grasp; attempt: number of the
    approach to the payload; grasp_text: newest decision about the payload.
    """

    reference: np.ndarray
    flying: bool = False
    time: float = -1.0
    phase: str = WAITING
    magnet: bool = False
    arm: bool = False
    regains: int = 0
    done: bool = False
    abort_reason: str = ""
    state: State = State.GROUNDED
    cause: str = ""
    grasp: Grasp = Grasp.NONE
    attempt: int = 0
    grasp_text: str = ""
