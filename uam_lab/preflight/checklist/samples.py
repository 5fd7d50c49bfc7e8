"""Samples of the vehicle in a person's hands, and a window of the newest ones."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
)


@dataclass(frozen=True)
class Sample:
    """Newest values of all sensors at `time` [s].

    position (3,) [m, world], attitude (4,) body → world [w x y z]: motion capture. gyro (4,): the
    integral of the gyroscope, a quaternion from any beginning. force (3,) [m/s^2, FLU]: specific
    force; rate (3,) [rad/s, FLU]: of the gyroscope. joints (n,) [rad]. commanded (3,) [rad/s, FLU]:
    body rates of the newest setpoint.
    """

    time: float
    position: np.ndarray
    attitude: np.ndarray
    gyro: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    joints: np.ndarray
    commanded: np.ndarray


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
