"""Faults of the IMUs (bias, saturation, dropout, stamps) and of the joint encoders."""

import numpy as np

from uam_control.settings.parameter_set import choice, integer, number
from uam_sim_bridge.faults.fault import Fault, Occurrence, PlantFault
from uam_sim_bridge.plant import Samples

COMPANION, AUTOPILOT, BOTH = "companion", "autopilot", "both"
UNIT = "affected IMU: the companion computer's, the autopilot's or both"
UNITS = (BOTH, COMPANION, AUTOPILOT)
AXES = ("x", "y", "z")
Imu = tuple[float, np.ndarray, np.ndarray]  # stamp [s], gyro [rad/s], specific force [m/s^2], FLU


class ImuFault(PlantFault):
    """A fault that changes each sample of one IMU or both: `altered`."""

    unit: str = choice(BOTH, UNIT, UNITS)

    def altered(self, now: Occurrence, stamp: float, gyro: np.ndarray, force: np.ndarray) -> Imu:
        """Return the sample as the fault changes it: gyro (3,) and specific force (3,), FLU."""
        raise NotImplementedError

    def sense(self, samples: Samples, now: Occurrence) -> None:
        if self.unit != AUTOPILOT and samples.imu is not None:
            samples.imu = self.altered(now, *samples.imu)
        if self.unit != COMPANION:
            samples.hil = self.altered(now, *samples.hil)


class ImuBias(ImuFault):
    """Gyroscope and accelerometer have a bias on one axis, constant or rising at first."""

    gyro: float = number(0.05, "bias of the gyroscope", "rad/s", -5.0, 5.0)
    accelerometer: float = number(0.5, "bias of the accelerometer", "m/s^2", -50.0, 50.0)
    axis: str = choice("x", "biased axis, FLU", AXES)
    over: float = number(0.0, "time in which the bias rises from zero", "s", 0.0, 1000.0)

    def altered(self, now: Occurrence, stamp: float, gyro: np.ndarray, force: np.ndarray) -> Imu:
        along = now.done(self.over) * np.eye(3)[AXES.index(self.axis)]
        return stamp, gyro + self.gyro * along, force + self.accelerometer * along


class ImuSaturation(ImuFault):
    """Gyroscope and accelerometer saturate at a small value on every axis."""

    gyro: float = number(0.2, "largest body rate", "rad/s", 0.0, 50.0)
    accelerometer: float = number(10.0, "largest specific force", "m/s^2", 0.0, 200.0)

    def altered(self, now: Occurrence, stamp: float, gyro: np.ndarray, force: np.ndarray) -> Imu:
        limited = np.clip(force, -self.accelerometer, self.accelerometer)
        return stamp, np.clip(gyro, -self.gyro, self.gyro), limited


class ImuDropout(PlantFault):
    """An IMU fails: the companion's gives no samples, the autopilot's repeats its last sample."""

    unit: str = choice(COMPANION, UNIT, UNITS)

    def sense(self, samples: Samples, now: Occurrence) -> None:
        if self.unit != AUTOPILOT:
            samples.imu = None
        if self.unit != COMPANION:  # the autopilot needs a sample at each tick
            now.memory = now.memory or samples.hil[1:]
            samples.hil = (samples.hil[0], *now.memory)


class ImuStamps(PlantFault):
    """The companion's IMU has stamps with jitter, and single samples are repeated or missing."""

    jitter: float = number(0.001, "largest error of a stamp, uniform", "s", 0.0, 0.01)
    repeated: float = number(0.01, "fraction of samples that arrive twice", "1", 0.0, 1.0)
    missing: float = number(0.01, "fraction of samples that do not arrive", "1", 0.0, 0.5)

    def sense(self, samples: Samples, now: Occurrence) -> None:
        late, repeated, missing = now.noise.random(3)
        if samples.imu is None or missing < self.missing:
            samples.imu = None
            return
        stamp, gyro, force = samples.imu
        samples.imu = stamp + self.jitter * (2.0 * late - 1.0), gyro, force
        samples.imu_copies += bool(repeated < self.repeated)


def of_the_companion(fault: Fault) -> bool:
    """Return whether a fault changes only the companion's IMU."""
    return isinstance(fault, ImuStamps) or getattr(fault, "unit", "") == COMPANION


class EncoderStuck(PlantFault):
    """A joint's encoder repeats its angle and reports zero velocity."""

    joint: int = integer(1, "joint number", 1, 7)

    def sense(self, samples: Samples, now: Occurrence) -> None:
        if samples.joints is None:
            return
        stamp, alpha, alpha_dot, torque = samples.joints
        joint = self.joint - 1
        if now.memory is None:
            now.memory = alpha[joint]
        alpha, alpha_dot = alpha.copy(), alpha_dot.copy()
        alpha[joint], alpha_dot[joint] = now.memory, 0.0
        samples.joints = stamp, alpha, alpha_dot, torque
