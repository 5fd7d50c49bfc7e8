"""Steps of the grasp executive, its decisions about the payload, and its output."""

from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np

from uam_control.grasp.windows import GraspWindow
from uam_control.settings.plain_members import plain_members


@plain_members
class Grasp(Enum):
    """What the executive knows about the payload; the value is used in texts and messages."""

    NONE = ""
    APPROACHED = "approached"
    HELD = "held"
    UNVERIFIED = "not verified"
    GIVEN_UP = "given up"
    ABSENT = "absent"
    LOST = "lost"
    RELEASED = "released"
    STUCK = "not released"


class GraspDecision(NamedTuple):
    """A decision at `stamp` [s]: state of the grasp, number of the approach, reason in one line."""

    stamp: float
    grasp: Grasp
    attempt: int
    text: str


@plain_members
class Step(Enum):
    """What the executive does."""

    IDLE = "no payload near"
    APPROACH = "before the descent"
    ALIGN = "waits above the payload"
    DESCEND = "descends"
    LIFT = "grips, climbs"
    VERIFY = "waits for evidence"
    RETREAT = "back to the start of the descent"
    CLIMB = "leaves a contact upwards"
    CARRY = "carries"
    RELEASE = "lets go"


@dataclass
class Directive:
    """Output of the executive."""

    pace: float = 1.0  # of the scenario's clock
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m] of its path
    grip: bool = False  # before the scenario says so
    without_descent: GraspWindow | None = None  # whose descent is left out
    land: str = ""  # reason to land
