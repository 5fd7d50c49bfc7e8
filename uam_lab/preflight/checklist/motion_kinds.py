"""What is measured in a motion by hand, and by which sensors."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from uam_control.maths.rotations import matrix_from_quaternion
from uam_lab.preflight.checklist.limits import MotionLimits
from uam_lab.preflight.checklist.observation import Sample, rotation_vector, up
from uam_lab.preflight.checklist.step import Finding

AXES = ("roll", "pitch", "yaw")
DIRECTIONS = ("forward", "left", "up")


@dataclass(frozen=True)
class Pose:
    """Means of some samples at `time` [s]; entries as in `Sample`."""

    time: float
    position: np.ndarray
    attitude: np.ndarray
    gyro: np.ndarray
    force: np.ndarray
    joints: np.ndarray
    commanded: np.ndarray

    @classmethod
    def of(cls, samples: Sequence[Sample]) -> Self:
        """Return the means of at least one sample; attitudes: of the middle sample."""
        middle = samples[len(samples) // 2]

        def mean(name: str) -> np.ndarray:
            return np.mean([getattr(one, name) for one in samples], axis=0)

        return cls(
            middle.time,
            mean("position"),
            middle.attitude,
            middle.gyro,
            mean("force"),
            mean("joints"),
            np.median([one.commanded for one in samples], axis=0),
        )


class Kind:
    """What a motion is measured by. labels: of its components; unit: of all of them."""

    labels: tuple[str, ...]
    unit: str

    def components(self, begin: Pose, now: Sample | Pose) -> np.ndarray:
        """Return the components (n,) of the motion since `begin`."""
        raise NotImplementedError

    def checks(self, begin: Pose, left: Sample, kept: Pose, sign: int) -> Iterator[Finding]:
        """Yield whether other sensors agree; nothing where no other one measures the motion."""
        yield from ()


class Turn(Kind):
    """A turn of the vehicle about its axes, by motion capture; checked by IMU and commands."""

    labels, unit = AXES, "rad"

    def __init__(self, axis: int, limits: MotionLimits) -> None:
        self._axis, self._limits = axis, limits

    def components(self, begin: Pose, now: Sample | Pose) -> np.ndarray:
        """Return the turn (3,) [rad] about roll, pitch and yaw axis since `begin`."""
        return rotation_vector(begin.attitude, now.attitude)

    def checks(self, begin: Pose, left: Sample, kept: Pose, sign: int) -> Iterator[Finding]:
        """Yield whether accelerometer, gyroscope and commands agree about the turn.

        left: the sample at which the pose before was left. The gyroscope is integrated from there,
        so that its bias does not add up while nothing moves.
        """
        limits, axis = self._limits, self._axis
        size = abs(float(self.components(begin, kept)[axis]))
        if axis < 2:
            before, after = (one / np.linalg.norm(one) for one in (begin.force, kept.force))
            tilted = up(kept.attitude) - up(begin.attitude)
            yield self._agreement("accelerometer", after - before, tilted, size)
        turned = rotation_vector(left.gyro, kept.gyro)
        turn = rotation_vector(left.attitude, kept.attitude)
        yield self._agreement("gyro", turned, turn, float(np.linalg.norm(turn)))
        against = -sign * kept.commanded[axis]
        others = float(np.max(np.abs(np.delete(kept.commanded, axis))))
        yield Finding(
            "commanded rate",
            f"{-against * sign:+.2f} rad/s, others up to {others:.2f}",
            f"at least {limits.rate_response:.3g} rad/s against the turn, others less",
            against >= limits.rate_response and others < against,
        )

    def _agreement(self, name: str, seen: np.ndarray, mocap: np.ndarray, size: float) -> Finding:
        limit = self._limits.agreement * size
        off = float(np.linalg.norm(seen - mocap))
        return Finding(
            f"{name} against mocap", f"{off:.3f} rad", f"at most {limit:.3f} rad", off <= limit
        )


class Shift(Kind):
    """A displacement of the vehicle, in the axes of its heading at the beginning."""

    labels, unit = DIRECTIONS, "m"

    def components(self, begin: Pose, now: Sample | Pose) -> np.ndarray:
        """Return the displacement (3,) [m] forward, left and up since `begin`."""
        nose = matrix_from_quaternion(begin.attitude)[:, 0]
        nose = np.array([nose[0], nose[1], 0.0]) / np.hypot(nose[0], nose[1])
        moved = now.position - begin.position
        return np.array([moved @ nose, nose[0] * moved[1] - nose[1] * moved[0], moved[2]])


class JointTurn(Kind):
    """A turn of a joint."""

    unit = "rad"

    def __init__(self, names: Sequence[str]) -> None:
        self.labels = tuple(names)

    def components(self, begin: Pose, now: Sample | Pose) -> np.ndarray:
        """Return the turns (n,) [rad] of all joints since `begin`."""
        return now.joints - begin.joints
