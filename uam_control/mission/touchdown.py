"""Whether the vehicle stands again, at the end of a landing or of a descent."""

from __future__ import annotations

import math

import numpy as np

from uam_control.coordinates import CHI, CHI_DOT, Z
from uam_control.maths.compiled import borrowing
from uam_control.mission.mission_parameters import MissionParameters


class Touchdown:
    """Detects the touchdown: low and slow for a time, and not before half of the way down."""

    def __init__(self) -> None:
        self._half_down = math.inf  # stamp [s] from which a descent may detect it
        self._at_rest_since: float | None = None

    def descend(self, stamp: float, end: float) -> None:
        """Begin a descent at `stamp`, planned until `end` [s]."""
        self._half_down = 0.5 * (stamp + end)

    def stay(self) -> None:
        """Give the descent up: a hold, or somebody else lands."""
        self._half_down = math.inf

    def late_in_descent(self, stamp: float) -> bool:
        """Return whether the second half of a descent has begun."""
        return stamp >= self._half_down

    @property
    def idle(self) -> bool:
        """Return whether no descent has begun, and the vehicle is not at rest on the ground."""
        return math.isinf(self._half_down) and self._at_rest_since is None

    def at_rest(self, stamp: float, on_ground: bool, p: MissionParameters) -> bool:
        """Return whether the vehicle has been on the ground for touchdown_time."""
        if not on_ground:
            self._at_rest_since = None
            return False
        if self._at_rest_since is None:
            self._at_rest_since = stamp
        return stamp - self._at_rest_since >= p.touchdown_time


@borrowing
def on_ground(state: np.ndarray, ground: float, height: float, speed: float) -> bool:
    """Return whether the vehicle is low and slow.

    state (3, 6 + n); ground [m]: its height; height [m], speed [m/s]: of `touchdown`.
    """
    return state[CHI, Z] < ground + height and abs(state[CHI_DOT, Z]) < speed
