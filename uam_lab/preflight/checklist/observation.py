"""What the checklist looks at: an observation of automatic items, samples of guided ones."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
)
from uam_control.supervision import PreflightCheck

SPAN = 2.0  # [s] of stamps that are kept
FEWEST = 5  # stamps
# of a period: a step that is longer by this much has a sample missing. Less than one, for stamps
# jitter; more than a half: frames on a simulation's ticks of 4 ms come 8 or 12 ms after each other
LATE = 0.75
GOOD, WARNING, BAD = "good", "warning", "bad"  # levels of a node


@dataclass(frozen=True)
class Sample:
    """Newest values of all sensors at `time` [s]."""

    time: float
    position: np.ndarray  # (3,) [m, world] by motion capture
    attitude: np.ndarray  # (4,) body → world [w x y z], by motion capture
    gyro: np.ndarray  # (4,) integral of the gyroscope, a quaternion from any beginning
    force: np.ndarray  # (3,) [m/s^2, FLU] specific force
    rate: np.ndarray  # (3,) [rad/s, FLU] of the gyroscope
    joints: np.ndarray  # (n,) [rad]
    commanded: np.ndarray  # (3,) [rad/s, FLU] body rates of the newest setpoint

    @classmethod
    def mean(cls, samples: Sequence[Self]) -> Self:
        """Return the means of at least one sample; the attitudes, and the time, of the middle one,
        the medians of `commanded`."""
        means = {
            name: np.mean([getattr(one, name) for one in samples], axis=0)
            for name in ("position", "force", "rate", "joints")
        }
        commanded = np.median([one.commanded for one in samples], axis=0)
        return replace(samples[len(samples) // 2], commanded=commanded, **means)


class GyroIntegral:
    """Integrates body rates to a quaternion (4,) [w x y z]."""

    LONGEST = 0.1  # [s] a longer gap is not bridged

    def __init__(self) -> None:
        self.value = np.array([1.0, 0.0, 0.0, 0.0])
        self._time: float | None = None

    def add(self, time: float, rate: np.ndarray) -> None:
        """Take the body rates (3,) [rad/s, FLU] at `time` [s]."""
        if self._time is not None and 0.0 < time - self._time < self.LONGEST:
            turn = quaternion_from_rotation_vector(rate * (time - self._time))
            self.value = quaternion_multiply(self.value, turn)
            self.value /= np.linalg.norm(self.value)
        self._time = time


class Window:
    """Samples of the last `span` [s], which may be changed."""

    LONGEST_GAP = 0.2  # [s] over a longer one nothing is known of the motion

    def __init__(self, span: float) -> None:
        self.span = span
        self._samples: deque[Sample] = deque()

    def add(self, sample: Sample) -> None:
        """Add the newest sample; forget all if time went back."""
        samples = self._samples
        if samples and sample.time < samples[-1].time:
            samples.clear()
        samples.append(sample)
        while samples[-1].time - samples[0].time > self.span + 1e-9:
            samples.popleft()

    def clear(self) -> None:
        """Forget all samples."""
        self._samples.clear()

    def last(self, span: float) -> list[Sample]:
        """Return the samples of the last `span` [s]; [] if the window does not reach back so far.

        A tenth of the span may lack at its beginning. [] also after a gap: the few samples that are
        left would look still, and their means would be of a motion.
        """
        samples = self._samples
        if not samples or samples[-1].time - samples[0].time < 0.9 * span:
            return []
        begin = samples[-1].time - span - 1e-9
        found = [one for one in samples if one.time >= begin]
        times = [begin, *(one.time for one in found)]
        if any(after - before > self.LONGEST_GAP for before, after in pairwise(times)):
            return []
        return found


def rotation_vector(begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the turn (3,) [rad] from attitude `begin` to `end` (4,), in the axes of `begin`."""
    turn = quaternion_multiply(begin * np.array([1.0, -1.0, -1.0, -1.0]), end)
    turn = turn if turn[0] >= 0.0 else -turn
    size = float(np.linalg.norm(turn[1:]))
    if size < 1e-12:
        return np.zeros(3)
    return turn[1:] * (2.0 * np.arctan2(size, turn[0]) / size)


def up(attitude: np.ndarray) -> np.ndarray:
    """Return the world's vertical (3,) in the axes of the body; attitude (4,) body → world."""
    return matrix_from_quaternion(attitude)[2]


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle [rad] between two vectors (3,)."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


@dataclass(frozen=True)
class StreamReport:
    """rate [Hz]; gap [s]: longest time without a sample; loss: share of missing samples, 0..1."""

    rate: float
    gap: float
    loss: float


class Stream:
    """Stamps of the last SPAN."""

    def __init__(self) -> None:
        self._stamps: deque[float] = deque()

    def add(self, stamp: float) -> None:
        """Take the stamp [s] of a sample; after a stamp that goes back the stream begins anew."""
        if self._stamps and stamp < self._stamps[-1]:
            self._stamps.clear()
        self._stamps.append(stamp)
        while stamp - self._stamps[0] > SPAN:
            self._stamps.popleft()

    def report(self, now: float) -> StreamReport | None:
        """Return the report at `now` [s]; None without samples in the last SPAN.

        The share of missing samples counts from the median distance of two stamps.
        """
        recent = [one for one in self._stamps if now - one <= SPAN]
        if len(recent) < FEWEST:
            return None
        steps = np.diff(recent)
        period = float(np.median(steps))
        if period <= 0.0:
            return None
        missing = float(np.sum(np.maximum(np.floor(steps / period - LATE), 0.0)))
        silence = max(0.0, now - recent[-1])
        # a stream that has stopped loses its rate
        rate = (len(recent) - 1) / (recent[-1] - recent[0] + max(0.0, silence - 10.0 * period))
        return StreamReport(
            rate, max(float(steps.max()), silence), missing / (missing + len(recent))
        )


class NodeReport(NamedTuple):
    """Newest diagnostics of a node: age [s], one of GOOD, WARNING, BAD, one line, values."""

    age: float
    level: str
    summary: str
    values: dict[str, str]


class Box(NamedTuple):
    """Corners (3,) [m, world]."""

    low: Sequence[float]
    high: Sequence[float]


@dataclass(frozen=True)
class Host:
    """The companion computer. None: not known."""

    disk: float | None = None  # [bytes] free for the recording
    synchronised: bool | None = None  # by the kernel
    jump: float = 0.0  # [s] of the clock since the start
    governors: tuple[str, ...] = ()  # of the cores, () without frequency scaling
    rtprio: float = 0.0  # highest real-time priority that is allowed


@dataclass(frozen=True)
class Resting:
    """Means of a short window of samples."""

    position: np.ndarray  # (3,) [m, world]
    joints: np.ndarray  # (n,) [rad]
    tilt: float  # [rad] by motion capture
    gravity_angle: float  # [rad] between the vertical of accelerometer and motion capture
    force: float  # [m/s^2] its size
    rate: float  # [rad/s] largest mean body rate
    spread: float  # [m] largest of the position

    @classmethod
    def of(cls, samples: Sequence[Sample]) -> Self:
        """Return the means of at least one sample."""
        vertical = np.mean([up(one.attitude) for one in samples], axis=0)
        mean = Sample.mean(samples)
        return cls(
            mean.position,
            mean.joints,
            angle_between(vertical, np.array([0.0, 0.0, 1.0])),
            angle_between(vertical, mean.force),
            float(np.linalg.norm(mean.force)),
            float(np.max(np.abs(mean.rate))),
            float(np.max(np.ptp([one.position for one in samples], axis=0))),
        )


@dataclass
class Observation:
    """All that is known now; None, NaN or empty: not known."""

    expected: tuple[str, ...]  # nodes that must run
    joint_names: tuple[str, ...]  # (n,)
    stowed: np.ndarray  # (n,) [rad]
    control_rate: float  # [Hz]
    gravity: float = 9.81
    nodes: dict[str, NodeReport] = field(default_factory=dict)
    mocap: StreamReport | None = None
    imu: StreamReport | None = None
    joint_states: StreamReport | None = None
    pose_age: float | None = None  # [s] mean age of a pose at its arrival
    resting: Resting | None = None
    temperatures: dict[str, float] = field(default_factory=dict)  # [deg C] by joint
    battery: float = math.nan  # 0..1
    connected: bool = False
    armed: bool = False
    killed: bool | None = None
    radio: bool | None = None  # whether the autopilot receives the pilot's radio
    differences: tuple[str, ...] = ()  # of its parameters from the required ones, one line each
    parameters_read: bool | None = None  # whether all of them have arrived
    fence: Box | None = None  # of the supervisor
    room: Box | None = None  # of the lab file
    preflight: tuple[PreflightCheck, ...] = ()
    host: Host = Host()
