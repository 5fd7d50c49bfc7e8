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


AIRBORNE_STATES = (
    State.TAKING_OFF,
    State.FLYING,
    State.HOLDING,
    State.LANDING,
    State.RELEASED,
    State.BLIND,
    State.FAILSAFE,
)
STOPPED_STATES = State.HOLDING, State.RELEASED, State.BLIND  # the scenario's clock stops
_S, _E = State, Event
_GUIDED = AIRBORNE_STATES[:4]
# from each of these states, to this one, by each of these events
_RULES = (
    ([_S.GROUNDED], _S.TAKING_OFF, [_E.READY]),
    ([_S.GROUNDED], _S.DISARMED, [_E.GIVEN_UP, _E.DISARM]),
    ([_S.TAKING_OFF], _S.FLYING, [_E.AIRBORNE]),
    ([_S.TAKING_OFF], _S.LANDING, [_E.HOLD_LIMIT]),
    ([_S.TAKING_OFF], _S.DISARMED, [_E.NO_LIFTOFF]),
    ([_S.TAKING_OFF, _S.FLYING], _S.LANDING, [_E.LANDING_DUE]),
    ([_S.TAKING_OFF, _S.FLYING, _S.HOLDING], _S.LANDING, [_E.LAND_LIMIT, _E.LAND]),
    ([_S.TAKING_OFF, _S.LANDING], _S.DISARMED, [_E.HARD_LIMIT_ON_GROUND, _E.DISARM_ON_GROUND]),
    ([_S.FLYING], _S.HOLDING, [_E.HOLD_LIMIT, _E.ARRIVED]),
    ([_S.FLYING], _S.LANDING, [_E.EXCEEDED_AGAIN, _E.MISSION_OVER]),
    ([_S.FLYING, _S.HOLDING], _S.HOLDING, [_E.HOLD]),
    ([_S.FLYING, _S.HOLDING], _S.FLYING, [_E.GOAL, _E.RESUME]),
    ([_S.HOLDING], _S.FLYING, [_E.CLEAR, _E.RESTARTED]),
    ([_S.HOLDING], _S.LANDING, [_E.CLEAR_TO_LAND, _E.RESTARTED_TO_LAND]),
    ([_S.HOLDING], _S.LANDING, [_E.HELD_TOO_LONG, _E.WAITED_TOO_LONG]),
    ([_S.LANDING], _S.DISARMED, [_E.TOUCHDOWN]),
    ([_S.LANDING], _S.FAILSAFE, [_E.NO_TOUCHDOWN]),
    ([_S.RELEASED], _S.HOLDING, [_E.REGAINED]),
    ([_S.RELEASED], _S.DISARMED, [_E.REGAINED_ON_GROUND]),
    ([_S.BLIND], _S.FAILSAFE, [_E.BLIND_TOO_LONG, _E.LAND]),
    ([_S.BLIND, _S.FAILSAFE], _S.HOLDING, [_E.AGREES]),
    ([_S.BLIND, _S.FAILSAFE], _S.LANDING, [_E.AGREES_TO_LAND]),
    ([_S.BLIND, _S.FAILSAFE], _S.DISARMED, [_E.DOWN]),
    ([_S.FAILSAFE], _S.DISARMED, [_E.DISARM]),
    (_GUIDED, _S.BLIND, [_E.BLIND_LIMIT]),
    ([*_GUIDED, _S.BLIND], _S.FAILSAFE, [_E.HARD_LIMIT]),
    ([*_GUIDED, _S.BLIND], _S.RELEASED, [_E.RELEASED]),
    (AIRBORNE_STATES, _S.DISARMED, [_E.LOST_ARMING, _E.STOPPED]),
)
TRANSITIONS = tuple(
    Transition(source, event, target)
    for sources, target, events in _RULES
    for source in sources
    for event in events
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


@plain_members
class Guide(Enum):
    """Behaviour of the reference."""

    NOTHING = "no reference for position and attitude"
    SCENARIO = "follows the scenario"
    STOP = "stops on the scenario's path and stays there"
    DESCEND = "descends vertically"


class Decision(NamedTuple):
    """The supervisor's output."""

    state: State
    cause: str  # why the state was entered
    guide: Guide
    arm: bool  # desired arming of the autopilot
    keep_magnet: bool  # an energised one stays so, unless the guide is SCENARIO
    stow: bool  # the arm moves to its landing angles, unless the guide is SCENARIO
    regains: int  # number of commands so far to regain a released vehicle


class StateTransition(NamedTuple):
    """A transition at `stamp` [s]."""

    stamp: float
    source: State
    target: State
    event: Event
    cause: str
