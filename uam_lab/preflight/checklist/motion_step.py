"""A step in which a person moves the vehicle or a joint, and keeps it there.

The vehicle rests, then each target is reached and kept, then the vehicle comes back. What is kept
is judged as a whole: the tested axis, its sign, the other axes, the other sensors. A motion in a
wrong direction fails as soon as it is kept.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from enum import Enum

import numpy as np

from uam_control.maths.rotations import matrix_from_quaternion
from uam_control.supervision import PreflightCheck
from uam_lab.flights.vehicle.checklist_parameters import MotionLimits
from uam_lab.preflight.checklist.observation import (
    Sample,
    Window,
    angle_between,
    rotation_vector,
    up,
)
from uam_lab.preflight.checklist.step import MOTION, Situation, Step, StepState

AXES = ("roll", "pitch", "yaw")
DIRECTIONS = ("forward", "left", "up")


class Kind:
    """What a motion is measured by. axis: index of the tested component; still: largest change of
    them while a pose is kept."""

    labels: tuple[str, ...]  # of the components
    unit = "rad"  # of all of them
    commands = arm_released = False  # see `Step`

    def __init__(self, axis: int, limits: MotionLimits) -> None:
        self.axis, self.limits, self.still = axis, limits, limits.still_angle

    def components(self, begin: Sample, now: Sample) -> np.ndarray:
        """Return the components (n,) of the motion since `begin`."""
        raise NotImplementedError

    def checks(
        self, begin: Sample, left: Sample, kept: Sample, sign: int
    ) -> Iterator[PreflightCheck]:
        """Yield whether other sensors agree; nothing where no other one measures the motion."""
        yield from ()


class Turn(Kind):
    """A turn of the vehicle about its axes, by motion capture; checked by IMU and commands."""

    labels = AXES
    commands = True  # the laws command body rates against it

    def components(self, begin: Sample, now: Sample) -> np.ndarray:
        """Return the turn (3,) [rad] about roll, pitch and yaw axis since `begin`."""
        return rotation_vector(begin.attitude, now.attitude)

    def checks(
        self, begin: Sample, left: Sample, kept: Sample, sign: int
    ) -> Iterator[PreflightCheck]:
        """Yield whether accelerometer, gyroscope and commands agree about the turn.

        left: the sample at which the pose before was left. The gyroscope is integrated from there,
        so that its bias does not add up while nothing moves.
        """
        limits, axis = self.limits, self.axis
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
        yield PreflightCheck(
            "commanded rate",
            f"{-against * sign:+.2f} rad/s, others up to {others:.2f}",
            f"at least {limits.rate_response:.3g} rad/s against the turn, others less",
            against >= limits.rate_response and others < against,
        )

    def _agreement(
        self, name: str, seen: np.ndarray, mocap: np.ndarray, size: float
    ) -> PreflightCheck:
        limit = self.limits.agreement * size
        off = float(np.linalg.norm(seen - mocap))
        return PreflightCheck(
            f"{name} against mocap", f"{off:.3f} rad", f"at most {limit:.3f} rad", off <= limit
        )


class Shift(Kind):
    """A displacement of the vehicle, in the axes of its heading at the beginning."""

    labels, unit = DIRECTIONS, "m"

    def __init__(self, axis: int, limits: MotionLimits) -> None:
        super().__init__(axis, limits)
        self.still = limits.still_position

    def components(self, begin: Sample, now: Sample) -> np.ndarray:
        """Return the displacement (3,) [m] forward, left and up since `begin`."""
        nose = matrix_from_quaternion(begin.attitude)[:, 0]
        nose = np.array([nose[0], nose[1], 0.0]) / np.hypot(nose[0], nose[1])
        moved = now.position - begin.position
        return np.array([moved @ nose, nose[0] * moved[1] - nose[1] * moved[0], moved[2]])


class JointTurn(Kind):
    """A turn of a joint, whose servo has no torque meanwhile."""

    arm_released = True

    def __init__(self, axis: int, limits: MotionLimits, names: Sequence[str]) -> None:
        super().__init__(axis, limits)
        self.labels = tuple(names)

    def components(self, begin: Sample, now: Sample) -> np.ndarray:
        """Return the turns (n,) [rad] of all joints since `begin`."""
        return now.joints - begin.joints


STILL_THERE = 0.25  # share of the amplitude within which a pose is not left yet
LEFT_BEHIND = 0.75  # share of the amplitude by which a kept pose is left before the next counts
_UPWARD = np.array([0.0, 0.0, 1.0])


class Stage(Enum):
    """What is waited for."""

    REST, MOVE, HOME = range(3)


class MotionStep(Step):
    """A motion along one axis to targets of one or both signs."""

    def __init__(
        self,
        name: str,
        kind: Kind,
        instructions: Sequence[str],
        amplitude: float,
        back: str = "Bring it back.",
    ) -> None:
        """instructions: of the targets, the first along the axis, the second against it; amplitude:
        least motion, in the unit of `kind`."""
        limits, axis = kind.limits, kind.axis
        others = limits.other_axes
        super().__init__(
            name,
            "",
            f"{kind.labels[axis]} at least {amplitude:.3g} {kind.unit} in the asked direction, "
            f"others at most {others:.3g} of it, all sensors agree",
            MOTION,
        )
        self.commands, self.arm_released = kind.commands, kind.arm_released
        self._kind, self._axis = kind, axis
        self._targets = list(zip((1, -1), instructions, strict=False))
        self._amplitude, self._still, self._limits = amplitude, kind.still, limits
        self._back = back
        self._window = Window(2.0 * max(limits.hold_time, limits.rest_time))
        self._stage, self._next = Stage.REST, 0
        self._begin: Sample | None = None
        self._from: np.ndarray | None = None  # components when the target became the next one
        self._left: Sample | None = None  # newest sample that is still there
        self._since: float | None = None
        self._texts: list[str] = []
        self._path: deque[np.ndarray] = deque()  # components of the samples in the window

    @property
    def instruction(self) -> str:
        """Return what the person does now."""
        if self._stage is Stage.REST:
            return "Hold the vehicle level and at rest."
        if self._stage is Stage.HOME:
            return self._back
        return self._targets[self._next][1]

    def begin(self, time: float) -> None:
        """Wait for rest, from which the motion is measured."""
        super().begin(time)
        self._rest(time)

    def _rest(self, time: float) -> None:
        self._window.clear()
        self._stage, self._next, self._begin, self._since = Stage.REST, 0, None, time
        self._texts = []
        self._path.clear()

    def update(self, now: Situation) -> None:
        """Judge the samples so far."""
        if now.sample is None:
            self.seen = "no samples of all sensors yet"
            return
        self._window.add(now.sample)
        if self._since is None:
            self._since = now.time
        {Stage.REST: self._wait_for_rest, Stage.MOVE: self._move, Stage.HOME: self._come_home}[
            self._stage
        ](now)
        if self.state is not StepState.PASSED and now.time - self._since > self._limits.step_time:
            doing = self.instruction
            self._fail(now.time, f"not within {self._limits.step_time:.0f} s: {doing}")
            self._rest(now.time)

    def _wait_for_rest(self, now: Situation) -> None:
        samples = self._window.last(self._limits.rest_time)
        if not samples:
            return
        pose = Sample.mean(samples)
        tilt = max(angle_between(up(pose.attitude), _UPWARD), angle_between(pose.force, _UPWARD))
        unrest = _unrest(pose, samples, self._limits)
        self.seen = unrest or f"tilted by {tilt:.2f} rad, at most {self._limits.upright:.2f}"
        if unrest or tilt > self._limits.upright:
            return
        self._begin, self._stage = pose, Stage.MOVE
        self._from, self._left = np.zeros(len(self._kind.labels)), samples[-1]
        self.seen = "at rest"

    def _move(self, now: Situation) -> None:
        begin, axis = self._begin, self._axis
        moved = self._kind.components(begin, now.sample)
        self.seen = self._shown(moved)
        if np.max(np.abs(moved - self._from)) < STILL_THERE * self._amplitude:
            self._left = now.sample
        samples, path = self._followed(moved)
        if not samples or np.max(np.ptp(path, axis=0)) > self._still:
            return
        kept = self._kind.components(begin, Sample.mean(samples))
        if np.max(np.abs(kept)) < self._amplitude:
            return
        if np.max(np.abs(kept - self._from)) < LEFT_BEHIND * self._amplitude:
            return
        sign = self._targets[self._next][0]
        pose = Sample.mean(samples)
        found = [self._direction(kept, sign), *self._kind.checks(begin, self._left, pose, sign)]
        failed = [one for one in found if not one.passed]
        if failed:
            self._fail(now.time, "; ".join(one.text for one in failed))
            self._stage = Stage.HOME
            return
        extra = "".join(f", {one.name} {one.value}" for one in found[1:])
        self._texts.append(f"{self._kind.labels[axis]} {kept[axis]:+.2f} {self._kind.unit}{extra}")
        self._next, self._from = self._next + 1, kept
        if self._next == len(self._targets):
            self._stage = Stage.HOME

    def _followed(self, moved: np.ndarray) -> tuple[list[Sample], np.ndarray]:
        """Return the samples within hold_time and their components (m, n); none if too few.

        moved (n,): components of the newest sample.
        """
        samples = self._window.last(self._limits.hold_time)
        self._path.append(moved)
        if not samples or len(self._path) < len(samples):
            return [], np.zeros((0, len(moved)))
        while len(self._path) > len(samples):
            self._path.popleft()
        return samples, np.array(self._path)

    def _direction(self, kept: np.ndarray, sign: int) -> PreflightCheck:
        """Return whether the tested axis has moved, in the asked direction, and no other."""
        axis, labels, unit = self._axis, self._kind.labels, self._kind.unit
        size = np.abs(kept)
        largest = int(np.argmax(size))
        others = float(np.max(np.delete(size, axis), initial=0.0))
        asked = f"{labels[axis]} {'+' if sign > 0 else '-'}"
        value = self._shown(kept)
        if largest != axis:
            value += f": {labels[largest]} has moved in its place, swapped?"
        elif sign * kept[axis] < 0.0:
            value += ": the other direction, reversed?"
        passed = (
            sign * kept[axis] >= self._amplitude and others <= self._limits.other_axes * size[axis]
        )
        limit = f"{asked}, at least {self._amplitude:.3g} {unit}, others at most "
        limit += f"{self._limits.other_axes:.3g} of it"
        return PreflightCheck("motion", value, limit, bool(passed))

    def _come_home(self, now: Situation) -> None:
        moved = self._kind.components(self._begin, now.sample)
        self.seen = self._shown(moved)
        near = max(self._limits.other_axes * self._amplitude, self._still)
        samples, path = self._followed(moved)
        if not samples or np.max(np.abs(path)) > near:
            return
        if np.max(np.ptp(path, axis=0)) > self._still:
            return
        if self._next == len(self._targets):
            self._pass(now.time, "; ".join(self._texts))
        else:  # after a failure: again
            self.tries += 1
            self._rest(now.time)

    def _shown(self, moved: np.ndarray) -> str:
        pairs = zip(self._kind.labels, moved, strict=True)
        return ", ".join(f"{label} {value:+.2f}" for label, value in pairs) + f" {self._kind.unit}"


def _unrest(pose: Sample, samples: Sequence[Sample], limits: MotionLimits) -> str:
    """Return what is not at rest in the samples, "" if everything is."""
    places = np.ptp([one.position for one in samples], axis=0)
    turns = [np.linalg.norm(rotation_vector(pose.attitude, one.attitude)) for one in samples]
    joints = np.ptp([one.joints for one in samples], axis=0)
    if np.max(places) > limits.still_position:
        return f"moving: {np.max(places):.2f} m, at most {limits.still_position:.2f}"
    if max(turns) > limits.still_angle:
        return f"turning: {max(turns):.2f} rad, at most {limits.still_angle:.2f}"
    if np.max(joints, initial=0.0) > limits.still_angle:
        return f"a joint turns: {np.max(joints):.2f} rad, at most {limits.still_angle:.2f}"
    return ""
