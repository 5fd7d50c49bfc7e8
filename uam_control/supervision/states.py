"""States, events and transitions of a supervised flight, as data, and what is decided at a tick.

There are no other transitions than those of `TRANSITIONS`. docs/supervision.md shows them as a
diagram; a test compares the two.
"""

from enum import Enum
from typing import NamedTuple

from uam_control.settings.plain_members import plain_members


@plain_members
class State(Enum):
    """State of the flight; the value is used in texts and messages."""

    GROUNDED = "grounded"
    TAKING_OFF = "taking off"
    FLYING = "flying"
    HOLDING = "holding"
    LANDING = "landing"
    RELEASED = "released"
    BLIND = "blind"
    FAILSAFE = "failsafe"
    DISARMED = "disarmed"


@plain_members
class Event(Enum):
    """Reason of a transition; the value is used in texts."""

    READY = "armed, no limit exceeded"
    AIRBORNE = "airborne"
    LANDING_DUE = "the scenario lands"
    NO_LIFTOFF = "no lift-off in time"
    TOUCHDOWN = "touchdown"
    HOLD_LIMIT = "hold limit exceeded"
    LAND_LIMIT = "land limit exceeded"
    HARD_LIMIT = "failsafe limit exceeded"
    BLIND_LIMIT = "failsafe limit of the motion capture exceeded"
    HARD_LIMIT_ON_GROUND = "failsafe limit exceeded on the ground"
    EXCEEDED_AGAIN = "hold limit exceeded after resumes_allowed resumes"
    AGREES = "the failed quantity agrees again"
    AGREES_TO_LAND = "the failed quantity agrees again, the landing goes on"
    BLIND_TOO_LONG = "blind for blind_time"
    DOWN = "landed, says the autopilot"
    HELD_TOO_LONG = "limit exceeded for hold_timeout"
    WAITED_TOO_LONG = "no command in time"
    CLEAR = "limit clear, when_clear: resume"
    CLEAR_TO_LAND = "limit clear, when_clear: land"
    RESTARTED = "lost controller restarted, after_restart: go_on"
    RESTARTED_TO_LAND = "lost controller restarted, after_restart: land"
    NO_TOUCHDOWN = "no touchdown in time"
    LOST_ARMING = "the autopilot disarmed"
    STOPPED = "killed"
    RELEASED = "the autopilot left OFFBOARD"
    REGAINED = "OFFBOARD is back"
    REGAINED_ON_GROUND = "OFFBOARD is back, on the ground"
    GIVEN_UP = "aborted before take-off"
    MISSION_OVER = "the mission ends early"
    HOLD = "hold by command"
    RESUME = "resume by command"
    GOAL = "goal by command"
    ARRIVED = "goal reached"
    LAND = "land by command"
    DISARM = "disarm by command"
    DISARM_ON_GROUND = "disarm by command, on the ground"


class Transition(NamedTuple):
    """A transition from one state to another."""

    source: State
    event: Event
    target: State


_S, _E = State, Event
TRANSITIONS = (
    Transition(_S.GROUNDED, _E.READY, _S.TAKING_OFF),
    Transition(_S.GROUNDED, _E.GIVEN_UP, _S.DISARMED),
    Transition(_S.GROUNDED, _E.DISARM, _S.DISARMED),
    Transition(_S.TAKING_OFF, _E.AIRBORNE, _S.FLYING),
    Transition(_S.TAKING_OFF, _E.HOLD_LIMIT, _S.LANDING),
    Transition(_S.TAKING_OFF, _E.LAND_LIMIT, _S.LANDING),
    Transition(_S.TAKING_OFF, _E.LAND, _S.LANDING),
    Transition(_S.TAKING_OFF, _E.LANDING_DUE, _S.LANDING),
    Transition(_S.TAKING_OFF, _E.HARD_LIMIT, _S.FAILSAFE),
    Transition(_S.TAKING_OFF, _E.HARD_LIMIT_ON_GROUND, _S.DISARMED),
    Transition(_S.TAKING_OFF, _E.DISARM_ON_GROUND, _S.DISARMED),
    Transition(_S.TAKING_OFF, _E.LOST_ARMING, _S.DISARMED),
    Transition(_S.TAKING_OFF, _E.NO_LIFTOFF, _S.DISARMED),
    Transition(_S.FLYING, _E.HOLD_LIMIT, _S.HOLDING),
    Transition(_S.FLYING, _E.HOLD, _S.HOLDING),
    Transition(_S.FLYING, _E.ARRIVED, _S.HOLDING),
    Transition(_S.FLYING, _E.GOAL, _S.FLYING),
    Transition(_S.FLYING, _E.RESUME, _S.FLYING),
    Transition(_S.FLYING, _E.LAND_LIMIT, _S.LANDING),
    Transition(_S.FLYING, _E.EXCEEDED_AGAIN, _S.LANDING),
    Transition(_S.FLYING, _E.MISSION_OVER, _S.LANDING),
    Transition(_S.FLYING, _E.LAND, _S.LANDING),
    Transition(_S.FLYING, _E.LANDING_DUE, _S.LANDING),
    Transition(_S.FLYING, _E.HARD_LIMIT, _S.FAILSAFE),
    Transition(_S.FLYING, _E.LOST_ARMING, _S.DISARMED),
    Transition(_S.HOLDING, _E.RESUME, _S.FLYING),
    Transition(_S.HOLDING, _E.GOAL, _S.FLYING),
    Transition(_S.HOLDING, _E.CLEAR, _S.FLYING),
    Transition(_S.HOLDING, _E.RESTARTED, _S.FLYING),
    Transition(_S.HOLDING, _E.RESTARTED_TO_LAND, _S.LANDING),
    Transition(_S.HOLDING, _E.CLEAR_TO_LAND, _S.LANDING),
    Transition(_S.HOLDING, _E.HELD_TOO_LONG, _S.LANDING),
    Transition(_S.HOLDING, _E.WAITED_TOO_LONG, _S.LANDING),
    Transition(_S.HOLDING, _E.HOLD, _S.HOLDING),
    Transition(_S.HOLDING, _E.LAND_LIMIT, _S.LANDING),
    Transition(_S.HOLDING, _E.LAND, _S.LANDING),
    Transition(_S.HOLDING, _E.HARD_LIMIT, _S.FAILSAFE),
    Transition(_S.HOLDING, _E.LOST_ARMING, _S.DISARMED),
    Transition(_S.LANDING, _E.TOUCHDOWN, _S.DISARMED),
    Transition(_S.LANDING, _E.HARD_LIMIT, _S.FAILSAFE),
    Transition(_S.LANDING, _E.HARD_LIMIT_ON_GROUND, _S.DISARMED),
    Transition(_S.LANDING, _E.NO_TOUCHDOWN, _S.FAILSAFE),
    Transition(_S.LANDING, _E.DISARM_ON_GROUND, _S.DISARMED),
    Transition(_S.LANDING, _E.LOST_ARMING, _S.DISARMED),
    Transition(_S.TAKING_OFF, _E.RELEASED, _S.RELEASED),
    Transition(_S.FLYING, _E.RELEASED, _S.RELEASED),
    Transition(_S.HOLDING, _E.RELEASED, _S.RELEASED),
    Transition(_S.LANDING, _E.RELEASED, _S.RELEASED),
    Transition(_S.RELEASED, _E.REGAINED, _S.HOLDING),
    Transition(_S.RELEASED, _E.REGAINED_ON_GROUND, _S.DISARMED),
    Transition(_S.RELEASED, _E.LOST_ARMING, _S.DISARMED),
    Transition(_S.TAKING_OFF, _E.BLIND_LIMIT, _S.BLIND),
    Transition(_S.FLYING, _E.BLIND_LIMIT, _S.BLIND),
    Transition(_S.HOLDING, _E.BLIND_LIMIT, _S.BLIND),
    Transition(_S.LANDING, _E.BLIND_LIMIT, _S.BLIND),
    Transition(_S.BLIND, _E.AGREES, _S.HOLDING),
    Transition(_S.BLIND, _E.AGREES_TO_LAND, _S.LANDING),
    Transition(_S.BLIND, _E.BLIND_TOO_LONG, _S.FAILSAFE),
    Transition(_S.BLIND, _E.HARD_LIMIT, _S.FAILSAFE),
    Transition(_S.BLIND, _E.LAND, _S.FAILSAFE),
    Transition(_S.BLIND, _E.DOWN, _S.DISARMED),
    Transition(_S.BLIND, _E.LOST_ARMING, _S.DISARMED),
    Transition(_S.BLIND, _E.RELEASED, _S.RELEASED),
    Transition(_S.FAILSAFE, _E.AGREES, _S.HOLDING),
    Transition(_S.FAILSAFE, _E.AGREES_TO_LAND, _S.LANDING),
    Transition(_S.FAILSAFE, _E.DOWN, _S.DISARMED),
    Transition(_S.FAILSAFE, _E.DISARM, _S.DISARMED),
    Transition(_S.TAKING_OFF, _E.STOPPED, _S.DISARMED),
    Transition(_S.FLYING, _E.STOPPED, _S.DISARMED),
    Transition(_S.HOLDING, _E.STOPPED, _S.DISARMED),
    Transition(_S.LANDING, _E.STOPPED, _S.DISARMED),
    Transition(_S.RELEASED, _E.STOPPED, _S.DISARMED),
    Transition(_S.BLIND, _E.STOPPED, _S.DISARMED),
    Transition(_S.FAILSAFE, _E.STOPPED, _S.DISARMED),
    Transition(_S.FAILSAFE, _E.LOST_ARMING, _S.DISARMED),
)
TARGETS = {(source, event): target for source, event, target in TRANSITIONS}
# causes in a flight without incidents
ORDINARY = {
    Event.READY: "armed",
    Event.AIRBORNE: "airborne",
    Event.LANDING_DUE: "as planned",
    Event.TOUCHDOWN: "touchdown",
    Event.ARRIVED: "goal reached",
}
AIRBORNE_STATES = (
    State.TAKING_OFF,
    State.FLYING,
    State.HOLDING,
    State.LANDING,
    State.RELEASED,
    State.BLIND,
    State.FAILSAFE,
)


@plain_members
class Guide(Enum):
    """Behaviour of the reference."""

    NOTHING = "no reference for position and attitude"
    SCENARIO = "follows the scenario"
    STOP = "stops on the scenario's path and stays there"
    DESCEND = "descends vertically"


class Decision(NamedTuple):
    """The supervisor's output.

    cause: why the state was entered. arm: desired arming of the autopilot. keep_magnet: an
    energised magnet stays energised; stow: the arm moves to its landing angles. Both apply only if
    the guide is not SCENARIO. regains: number of commands so far to regain a released vehicle.
    """

    state: State
    cause: str
    guide: Guide
    arm: bool
    keep_magnet: bool
    stow: bool
    regains: int


class StateTransition(NamedTuple):
    """A transition at `stamp` [s]."""

    stamp: float
    source: State
    target: State
    event: Event
    cause: str
