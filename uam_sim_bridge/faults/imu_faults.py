"""Faults of the IMUs (bias, saturation, dropout) and of the joint encoders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from uam_control.settings.parameter_set import choice, number
from uam_sim_bridge.faults.fault import Effect, PlantFault
from uam_sim_bridge.plant import Samples

COMPANION, AUTOPILOT, BOTH = "companion", "autopilot", "both"
UNIT = "affected IMU: the companion computer's, the autopilot's or both"
UNITS = (BOTH, COMPANION, AUTOPILOT)
AXES = ("x", "y", "z")


class ImuEffect(Effect):
    """Changes the samples of one IMU or both.

    alter: takes and returns stamp [s], gyro (3,) [rad/s, FLU], specific force (3,) [m/s^2, FLU].
    """

    def __init__(
        self,
        unit: str,
        alter: Callable[[float, np.ndarray, np.ndarray], tuple[float, np.ndarray, np.ndarray]],
    ):
        self._unit, self._alter = unit, alter

    def sense(self, samples: Samples) -> None:
        if self._unit != AUTOPILOT and samples.imu is not None:
            samples.imu = self._alter(*samples.imu)
        if self._unit != COMPANION:
            samples.hil = self._alter(*samples.hil)


@dataclass(frozen=True)
class ImuBias(PlantFault):
    NAME: ClassVar[str] = "imu_bias"
    ABOUT: ClassVar[str] = "gyroscope and accelerometer have a constant bias on one axis"

    gyro: float = number(0.05, "bias of the gyroscope", "rad/s", -5.0, 5.0)
    accelerometer: float = number(0.5, "bias of the accelerometer", "m/s^2", -50.0, 50.0)
    axis: str = choice("x", "biased axis, FLU", AXES)
    unit: str = choice(BOTH, UNIT, UNITS)

    def effect(self, noise: np.random.Generator) -> Effect:
        along = np.eye(3)[AXES.index(self.axis)]
        gyro, force = self.gyro * along, self.accelerometer * along
        return ImuEffect(self.unit, lambda t, rates, f: (t, rates + gyro, f + force))


@dataclass(frozen=True)
class ImuSaturation(PlantFault):
    NAME: ClassVar[str] = "imu_saturation"
    ABOUT: ClassVar[str] = "gyroscope and accelerometer saturate at a small value on every axis"

    gyro: float = number(0.2, "largest body rate", "rad/s", 0.0, 50.0)
    accelerometer: float = number(10.0, "largest specific force", "m/s^2", 0.0, 200.0)
    unit: str = choice(BOTH, UNIT, UNITS)

    def effect(self, noise: np.random.Generator) -> Effect:
        def alter(
            stamp: float, rates: np.ndarray, force: np.ndarray
        ) -> tuple[float, np.ndarray, np.ndarray]:
            limited = np.clip(force, -self.accelerometer, self.accelerometer)
            return stamp, np.clip(rates, -self.gyro, self.gyro), limited

        return ImuEffect(self.unit, alter)


@dataclass(frozen=True)
class ImuDropout(PlantFault):
    NAME: ClassVar[str] = "imu_dropout"
    ABOUT: ClassVar[str] = (
        "an IMU fails: the companion's gives no samples, the autopilot's repeats its last sample"
    )

    unit: str = choice(COMPANION, UNIT, UNITS)

    def effect(self, noise: np.random.Generator) -> Effect:
        return Silent(self.unit)


class Silent(Effect):
    """Removes the companion's samples; repeats the autopilot's, which needs one at each tick."""

    def __init__(self, unit: str):
        self._unit = unit
        self._held: tuple | None = None

    def sense(self, samples: Samples) -> None:
        if self._unit != AUTOPILOT:
            samples.imu = None
        if self._unit != COMPANION:
            self._held = self._held or samples.hil[1:]
            samples.hil = (samples.hil[0], *self._held)


@dataclass(frozen=True)
class EncoderStuck(PlantFault):
    NAME: ClassVar[str] = "encoder_stuck"
    ABOUT: ClassVar[str] = "a joint's encoder repeats its angle and reports zero velocity"

    joint: float = number(1, "joint number", "1", 1, 7)

    def effect(self, noise: np.random.Generator) -> Effect:
        return Stuck(int(self.joint) - 1)


class Stuck(Effect):
    """Holds the joint's first angle, with zero velocity."""

    def __init__(self, joint: int):
        self._joint = joint
        self._angle: float | None = None

    def sense(self, samples: Samples) -> None:
        if samples.joints is None:
            return
        stamp, alpha, alpha_dot, torque = samples.joints
        if self._angle is None:
            self._angle = alpha[self._joint]
        alpha, alpha_dot = alpha.copy(), alpha_dot.copy()
        alpha[self._joint], alpha_dot[self._joint] = self._angle, 0.0
        samples.joints = stamp, alpha, alpha_dot, torque


FAULTS = (ImuBias, ImuSaturation, ImuDropout, EncoderStuck)
