"""Inputs of the grasp executive at one of its steps: running means, the tool now and before."""

import math
from dataclasses import dataclass, field

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
MEMORY = 0.8  # [s] time constant of the means


@dataclass
class Sight:
    """What a vehicle can measure for a grasp; NaN: unknown.

    A payload that stands is compared with `tool`, its old pose is still true. One that may hang
    on the tool is compared with `tool_then`.
    """

    stamp: float  # [s]
    time: float  # [s] of the scenario
    tool: np.ndarray  # (3,) [m, world] face, from the estimate
    error: np.ndarray = field(default_factory=lambda: np.zeros(3))  # position - reference
    payload: np.ndarray = field(default_factory=lambda: np.full(3, math.nan))  # grip point, mocap
    lift: float = math.nan  # [N] filtered collective thrust
    throttle: float = math.nan  # the same as sent, 0..1
    effort: float = math.nan  # [N m] measured torque of the first joint
    lever: float = 0.0  # [m] horizontal distance of the tool from that joint
    on_path: bool = True  # whether it flies on the path, and not on its way back to it
    tool_then: np.ndarray | None = None  # (3,) at the stamp of the payload's pose; None: tool
    ahead: np.ndarray = field(default_factory=lambda: np.zeros(3))  # way until descent
    shifting: bool = False  # whether the path is still on its way to the last correction
    opening: float = math.nan  # [m] of fingers
    squeeze: float = math.nan  # [N] of fingers

    def __post_init__(self) -> None:
        if self.tool_then is None:
            self.tool_then = self.tool

    @property
    def tracked(self) -> bool:
        """Whether the payload's pose is known."""
        x, y, z = self.payload.tolist()
        return math.isfinite(x) and math.isfinite(y) and math.isfinite(z)


class RunningMean:
    """Exponential mean and standard deviation of a vector, with the time constant MEMORY."""

    def __init__(self) -> None:
        self._stamp = -math.inf
        self.mean = np.zeros(0)
        self._square = np.zeros(0)
        self._begun = math.inf

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviation per entry."""
        return np.sqrt(np.maximum(self._square - self.mean**2, 0.0))

    def span(self, stamp: float) -> float:
        """Return the time [s] over which values were taken, at `stamp` [s]."""
        return stamp - self._begun

    def restart(self) -> None:
        """Forget all values."""
        self._begun = math.inf

    def add(self, stamp: float, value: np.ndarray) -> None:
        """Add value (n,) at `stamp` [s]; values that are not finite restart the mean."""
        if not math.isfinite(sum(value.tolist())):
            self.restart()
            return
        if self._begun == math.inf:
            self._begun, self.mean, self._square = stamp, value.copy(), value**2
        else:  # a plain mean at first, so that the first value weighs no more than the others
            step = stamp - self._stamp
            gain = step / min(MEMORY, stamp - self._begun + step)
            blend(value, gain, self.mean, self._square)
        self._stamp = stamp


@jit
def blend(value: np.ndarray, gain: float, mean: np.ndarray, square: np.ndarray) -> None:
    """Move mean and square (n,) towards value and its square by the part `gain`, in place."""
    for i in range(len(value)):
        mean[i] += gain * (value[i] - mean[i])
        square[i] += gain * (value[i] * value[i] - square[i])


class Lasting:
    """Time since a condition became true."""

    def __init__(self) -> None:
        self._since = math.inf

    def restart(self) -> None:
        """Forget the condition."""
        self._since = math.inf

    def __call__(self, stamp: float, condition: bool) -> float:
        """Return for how long [s] `condition` is true at `stamp` [s]; -inf if it is false."""
        self._since = min(self._since, stamp) if condition else math.inf
        return stamp - self._since


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
