"""What the supervisor decides: its output at a tick, and the transitions of its state."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from uam_control.settings.plain_members import plain_members
from uam_control.supervision.states import Event, State


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
