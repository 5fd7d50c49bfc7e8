"""Courses of the reference, the cues that change them, and the transitions, as data.

There are no other transitions than those of `COURSES`. The arm has its own motion beside them.
"""

from enum import Enum
from typing import NamedTuple

from uam_control.settings.plain_members import plain_members


@plain_members
class Course(Enum):
    """What the reference of the base does; the value is used in texts."""

    PATH = "follows the path"
    STOP = "stops on the path"
    PLAN = "flies a plan"
    BRAKE = "brakes"
    REST = "brakes, then returns"
    BACK = "returns to the path"
    END = "ends the flight"


@plain_members
class Cue(Enum):
    """Reason of a change; the value is used in texts. RESTED and ARRIVED come by time."""

    STOP = "stop"
    GOAL = "goal"
    ARM_GOAL = "goal of the arm"
    STAY = "begin in the vehicle's motion"
    RETREAT = "move clear of an obstacle"
    GO_ON = "go on"
    WAIT = "go on, not at rest yet"
    RESTED = "at rest"
    ARRIVED = "on the path, arm at its angles"
    END = "descend"


class Change(NamedTuple):
    """A change from one course to another."""

    source: Course
    cue: Cue
    target: Course


_C = Course
_ON_PATH, _BRAKES = (_C.PATH, _C.STOP, _C.BACK), (_C.BRAKE, _C.REST)
_IN_FLIGHT = (*_ON_PATH, _C.PLAN, *_BRAKES)
COURSES = (
    *(Change(source, cue, _C.STOP) for cue in (Cue.STOP, Cue.ARM_GOAL) for source in _ON_PATH),
    *(Change(source, cue, _C.BRAKE) for cue in (Cue.STOP, Cue.ARM_GOAL) for source in _BRAKES),
    *(Change(_C.PLAN, cue, _C.PLAN) for cue in (Cue.STOP, Cue.ARM_GOAL)),
    *(Change(source, Cue.GOAL, _C.PLAN) for source in _IN_FLIGHT),
    *(Change(source, cue, _C.BRAKE) for cue in (Cue.STAY, Cue.RETREAT) for source in _IN_FLIGHT),
    *(Change(source, Cue.GO_ON, _C.BACK) for source in (*_ON_PATH, _C.PLAN, _C.BRAKE)),
    *(Change(source, Cue.WAIT, _C.REST) for source in _BRAKES),
    Change(_C.REST, Cue.RESTED, _C.BACK),
    Change(_C.BACK, Cue.ARRIVED, _C.PATH),
    *(Change(source, Cue.END, _C.END) for source in _C),
    Change(_C.END, Cue.STOP, _C.STOP),
)
NEXT = {(source, cue): target for source, cue, target in COURSES}
