"""The end effector in the world: its place now and in the last seconds, the levers of a weight."""

import math

import numpy as np

from uam_control.ages import AHEAD
from uam_control.arm.chain import Chain
from uam_control.arm.hand import hand_in_world
from uam_control.arm.kinematics import hand_jacobian
from uam_control.coordinates import ALPHA, ROLL
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import matrix_from_euler
from uam_control.maths.vectors import dot, times, vector

ROWS = 512  # 10 s, the largest payload_age, at 50 Hz


@jit
def hand_and_levers(chain: Chain, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the end effector (3,) [m, world], and its height per angle of each joint (n,) [m/rad].

    chi (6 + n,): generalised coordinates. A weight there needs its lever in torque at the joint.
    """
    place, _ = hand_in_world(chain, chi)
    up, count = vector(matrix_from_euler(chi[ROLL:ALPHA])[2]), len(chi) - ALPHA
    jacobian, hand, levers = np.empty((6, count)), np.empty(3), np.empty(count)
    hand_jacobian(chain, chi[ALPHA:], times(-1.0, up), jacobian)
    hand[0], hand[1], hand[2] = place
    for i in range(count):
        levers[i] = dot(up, vector(jacobian[:3, i]))
    return hand, levers


class PlaceHistory:
    """Places (3,) [m, world] with rising stamps [s]; the oldest ones are overwritten."""

    def __init__(self) -> None:
        self._stamps, self._places = np.zeros(ROWS), np.zeros((ROWS, 3))
        self._count = 0

    def restart(self) -> None:
        """Forget all places."""
        self._count = 0

    def add(self, stamp: float, place: np.ndarray) -> None:
        """Add place (3,) [m] at `stamp` [s]; a stamp that does not rise restarts the history."""
        if self._count and not stamp > self._stamps[(self._count - 1) % ROWS]:
            self._count = 0
        row = self._count % ROWS
        self._stamps[row], self._places[row] = stamp, place
        self._count += 1

    def at(self, stamp: float) -> np.ndarray:
        """Return the place (3,) [m] at `stamp` [s], NaN if it is older than the oldest one.

        Between two places it is interpolated. It is extrapolated for up to AHEAD.
        """
        stamps, places, count = self._stamps, self._places, self._count
        newest = (count - 1) % ROWS
        if count and stamp == stamps[newest]:
            return places[newest].copy()
        if count and stamp <= stamps[newest] + AHEAD:
            for i in range(count - 2, max(count - 1 - ROWS, -1), -1):  # the first ones most often
                before, after = i % ROWS, (i + 1) % ROWS
                if stamp >= stamps[before]:
                    share = (stamp - stamps[before]) / (stamps[after] - stamps[before])
                    return places[before] + share * (places[after] - places[before])
        return np.full(3, math.nan)
