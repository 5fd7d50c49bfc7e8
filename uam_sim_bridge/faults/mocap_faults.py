"""Faults of the motion capture: dropout, freeze, jump, exchanged axes, latency, outliers, clock."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from uam_control.maths.rotations import quaternion_from_rotation_vector, quaternion_multiply
from uam_control.settings.parameter_set import choice, number
from uam_sim_bridge.faults.fault import Effect, PlantFault
from uam_sim_bridge.plant import Samples

AXES = {"xy": [1, 0, 2], "xz": [2, 1, 0], "yz": [0, 2, 1]}


class PoseEffect(Effect):
    """Changes each pose.

    alter: takes and returns stamp [s], position (3,) [m, ENU], quaternion (4,) FLU → ENU [w x y z];
    it returns None for a dropped pose.
    """

    def __init__(
        self,
        alter: Callable[
            [float, np.ndarray, np.ndarray], tuple[float, np.ndarray, np.ndarray] | None
        ],
    ):
        self._alter = alter

    def sense(self, samples: Samples) -> None:
        if samples.mocap is not None:
            samples.mocap = self._alter(*samples.mocap)


@dataclass(frozen=True)
class MocapDropout(PlantFault):
    NAME: ClassVar[str] = "mocap_dropout"
    ABOUT: ClassVar[str] = "no motion-capture poses arrive"

    def effect(self, noise: np.random.Generator) -> Effect:
        return PoseEffect(lambda *pose: None)


@dataclass(frozen=True)
class MocapFreeze(PlantFault):
    NAME: ClassVar[str] = "mocap_freeze"
    ABOUT: ClassVar[str] = "the motion capture repeats its last pose, with new stamps"

    def effect(self, noise: np.random.Generator) -> Effect:
        held = []

        def repeat(stamp: float, *pose) -> tuple[float, np.ndarray, np.ndarray]:
            held[:] = held or pose
            return (stamp, *held)

        return PoseEffect(repeat)


@dataclass(frozen=True)
class MocapJump(PlantFault):
    NAME: ClassVar[str] = "mocap_jump"
    ABOUT: ClassVar[str] = "poses are displaced and rotated, as after a shift of the origin"

    x: float = number(0.3, "displacement along x", "m", -10.0, 10.0)
    y: float = number(0.0, "displacement along y", "m", -10.0, 10.0)
    z: float = number(0.0, "displacement along z", "m", -10.0, 10.0)
    yaw: float = number(0.0, "rotation of the attitude about z", "rad", -math.pi, math.pi)

    def effect(self, noise: np.random.Generator) -> Effect:
        offset = np.array([self.x, self.y, self.z])
        turn = quaternion_from_rotation_vector(np.array([0.0, 0.0, self.yaw]))
        return PoseEffect(
            lambda stamp, position, q: (stamp, position + offset, quaternion_multiply(turn, q))
        )


@dataclass(frozen=True)
class MocapSwap(PlantFault):
    NAME: ClassVar[str] = "mocap_swap"
    ABOUT: ClassVar[str] = "two axes of the position are exchanged, as after a wrong calibration"

    axes: str = choice("xy", "exchanged axes", tuple(AXES))

    def effect(self, noise: np.random.Generator) -> Effect:
        order = AXES[self.axes]
        return PoseEffect(lambda stamp, position, q: (stamp, position[order], q))


@dataclass(frozen=True)
class MocapLatency(PlantFault):
    NAME: ClassVar[str] = "mocap_latency"
    ABOUT: ClassVar[str] = "poses arrive later; their stamp is still that of the exposure"

    delay: float = number(0.1, "delay added to the usual latency", "s", 0.0, 5.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        return Late(self.delay)


class Late(Effect):
    """Delays poses by `delay` [s], by the stamps of the autopilot's IMU."""

    def __init__(self, delay: float):
        self._delay = delay
        self._waiting: deque[tuple[float, tuple]] = deque()

    def sense(self, samples: Samples) -> None:
        now = samples.hil[0]
        if samples.mocap is not None:
            self._waiting.append((now + self._delay, samples.mocap))
        due = self._waiting and self._waiting[0][0] <= now + 1e-9
        samples.mocap = self._waiting.popleft()[1] if due else None


@dataclass(frozen=True)
class MocapOutliers(PlantFault):
    NAME: ClassVar[str] = "mocap_outliers"
    ABOUT: ClassVar[str] = "single poses are displaced in random directions"

    share: float = number(0.05, "fraction of displaced poses", "1", 0.0, 1.0)
    distance: float = number(0.5, "displacement", "m", 0.0, 100.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        def alter(
            stamp: float, position: np.ndarray, quaternion: np.ndarray
        ) -> tuple[float, np.ndarray, np.ndarray]:
            direction, drawn = noise.standard_normal(3), noise.random()
            if drawn < self.share:
                position = position + self.distance * direction / np.linalg.norm(direction)
            return stamp, position, quaternion

        return PoseEffect(alter)


@dataclass(frozen=True)
class ClockJump(PlantFault):
    NAME: ClassVar[str] = "clock_jump"
    ABOUT: ClassVar[str] = (
        "the clock of the motion-capture computer is wrong, and so are the stamps"
    )

    step: float = number(0.5, "error of the clock, positive if ahead", "s", -100.0, 100.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        return PoseEffect(lambda stamp, *pose: (max(0.0, stamp + self.step), *pose))


FAULTS = (
    MocapDropout,
    MocapFreeze,
    MocapJump,
    MocapSwap,
    MocapLatency,
    MocapOutliers,
    ClockJump,
)
