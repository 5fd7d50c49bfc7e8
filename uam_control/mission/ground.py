"""The vehicle and the ground: whether it stands again, and the pose that is followed there."""

import math

import numpy as np

from uam_control.coordinates import ALPHA, ATTITUDE, CHI, CHI_DOT, YAW, Z
from uam_control.maths.compiled import borrowing
from uam_control.mission.mission_output import DRY_RUN, HAND_CHECK, MissionOutput
from uam_control.mission.mission_parameters import MissionParameters

SEEKING = 0.2  # [m/s] downwards, of a reference that seeks the ground
BEHIND = 0.25  # [m] of a vehicle above such a reference: it stands
SINKING, STILL = 0.2, 0.05  # [m/s] downwards: a landing, and the end of it


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


def seek_ground(reference: np.ndarray, since: float) -> None:
    """Let a reference (3, 6 + n) go on downwards that has been at its end `since` [s].

    Where the frame of the poses has drifted the ground is lower, or higher, than at take-off.
    """
    if since > 0.0:
        reference[CHI, Z] -= SEEKING * since
        reference[CHI_DOT, Z] -= SEEKING


def supported(state: np.ndarray, reference: np.ndarray, speed: float) -> bool:
    """Return whether the vehicle does not follow a descent: it stands on something.

    state, reference (3, 6 + n); speed [m/s]: that counts as at rest.
    """
    behind = state[CHI, Z] - reference[CHI, Z]
    return bool(behind > BEHIND and abs(state[CHI_DOT, Z]) < speed)


class Standing:
    """The vehicle sank, and sinks no more. `value`: until it sinks again.

    The autopilot's land detector needs seconds, and may find no ground under an arm.
    """

    def __init__(self) -> None:
        self.value = self._sank = False

    def update(self, rate: float) -> bool:
        """Take the vertical rate [m/s], up; return whether `value` has changed."""
        before = self.value
        if rate < -SINKING:
            self._sank, self.value = True, False
        elif self._sank and rate > -STILL:
            self.value = True
        return self.value is not before


class GroundPose:
    """Writes the reference of a vehicle that has not started, and says that it flies.

    The laws then compute commands, which nobody obeys: nothing is armed.
    """

    def __init__(self) -> None:
        self._pose: np.ndarray | None = None  # (6 + n,) at the begin

    def dry_run(self, output: MissionOutput, state: np.ndarray) -> None:
        """Follow the pose of the first finite state (3, 6 + n), level."""
        if self._pose is None and np.all(np.isfinite(state)):
            self._pose = state[CHI].copy()
            self._pose[ATTITUDE] = 0.0, 0.0, state[CHI, YAW]
        if self._pose is not None:
            output.reference[CHI, :ALPHA] = self._pose[:ALPHA]
            output.flying, output.phase = True, DRY_RUN

    def hand_check(self, output: MissionOutput, state: np.ndarray, looks: bool) -> None:
        """Let the control laws work while the checklist `looks` at their commands.

        The reference is the present position, level, with the heading of the beginning: the laws
        then turn the vehicle back. state (3, 6 + n).
        """
        if not looks or not np.all(np.isfinite(state)):
            if self._pose is not None:
                self._pose = None
                output.reference[CHI, :ALPHA] = 0.0
            return
        if self._pose is None:
            self._pose = state[CHI].copy()
        output.reference[CHI, :ALPHA] = state[CHI, :ALPHA]
        output.reference[CHI, ATTITUDE] = 0.0, 0.0, self._pose[YAW]
        output.flying, output.phase = True, HAND_CHECK
