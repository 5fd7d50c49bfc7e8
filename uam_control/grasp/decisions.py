"""Decisions about the payload, for log, mission status and metrics."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

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
