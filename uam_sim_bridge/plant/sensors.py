"""Sensor models: rate, noise, bias, quantisation and latency; the noise is seeded."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

import numpy as np

from uam_control.maths.compiled import jit, prepared
from uam_control.maths.rotations import quaternion_from_rotation_vector, quaternion_multiply

BLOCK = 256  # noise samples drawn per call of the generator; the sequence is the same for any


class Noise:
    """White noise with given standard deviations (width,), drawn in blocks; (width,) per call.

    `rows` (BLOCK, width): the present block; `used`: how many of them were returned.
    """

    def __init__(self, generator: np.random.Generator, deviations: np.ndarray) -> None:
        self._generator = generator
        self._deviations = deviations
        self.rows = np.empty((BLOCK, len(deviations)))
        self.used = BLOCK

    def __call__(self) -> np.ndarray:
        self.draw()
        row = self.rows[self.used]
        self.used += 1
        return row

    def draw(self) -> bool:
        """Draw the next block if the present one is used up; return whether it was."""
        if self.used < BLOCK:
            return False
        self.rows = self._generator.standard_normal(self.rows.shape) * self._deviations
        self.used = 0
        return True


class Delay:
    """Delay line of a number of ticks. No sample overtakes another."""

    def __init__(self, ticks: int) -> None:
        self.ticks = ticks
        self.queue: deque[tuple[int, tuple]] = deque()  # tick at which it is due, sample

    def __call__(self, tick: int, sample: tuple | None, added: int = 0) -> tuple | None:
        """Store the sample taken at `tick`, if any; return the sample due by then, or None.

        added: ticks by which this sample is later than usual.
        """
        if sample is not None:
            self.queue.append((tick + self.ticks + added, sample))
        if self.queue and self.queue[0][0] <= tick:
            return self.queue.popleft()[1]
        return None


def generators(seed: int, count: int) -> list[np.random.Generator]:
    """Return `count` independent generators, one per noise source, from one seed."""
    return [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(count)]


class Imu:
    """Gyroscope and accelerometer, FLU; `disturbed` adds `bias` (6,) and `noise` to the truth."""

    def __init__(self, numbers: dict, scale: float, generator: np.random.Generator) -> None:
        """numbers: `sensors.imu` of the vehicle; scale: factor on noise and bias."""
        gyro, accelerometer = numbers["gyro_noise"], numbers["accelerometer_noise"]
        biases = [numbers["gyro_bias"]] * 3 + [numbers["accelerometer_bias"]] * 3
        self.bias = scale * generator.standard_normal(6) * np.array(biases)
        self.noise = Noise(generator, scale * np.array([gyro] * 3 + [accelerometer] * 3))


class Mocap:
    """OptiTrack: pose at its own rate."""

    def __init__(self, numbers: dict, scale: float, generator: np.random.Generator) -> None:
        """numbers: `sensors.mocap` of the vehicle; scale: factor on noise."""
        self.period = 1.0 / numbers["rate"]
        self.next = 0.0  # [s] of the next pose
        deviations = [numbers["position_noise"]] * 3 + [numbers["attitude_noise"]] * 3
        self.noise = Noise(generator, scale * np.array(deviations))
        any_length = np.empty(3)
        self._noisy = prepared(noisy_pose, *(any_length,) * 5)

    def due(self, time: float) -> bool:
        """Return whether mocap takes a pose at `time` [s]; call it once per tick."""
        if time + 1e-9 < self.next:
            return False
        if time > self.next + self.period:  # the first tick of a plant that begins later
            self.next = time
        self.next += self.period
        return True

    def sample(self, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position (3,) [m, ENU] and quaternion (4,) [w x y z], FLU → ENU, with noise."""
        place, attitude = np.empty(3), np.empty(4)
        self._noisy(position, quaternion, self.noise(), place, attitude)
        return place, attitude


class Encoders:
    """Dynamixel position and velocity with their quantisation: `units` (2,) of `quantised`."""

    def __init__(self, numbers: dict) -> None:
        """numbers: `sensors.joints` of the vehicle."""
        self.units = np.array([2.0 * np.pi / numbers["counts_per_turn"], numbers["velocity_unit"]])


class SampleRows:
    """For each tick: noise of the IMU (6,), row of its samples (6 + 3 n,), and its parts.

    The parts are views: gyro, specific force (3,), angles, velocities, torques (n,). A row is
    written once and never again: whoever has a sample may keep it.
    """

    def __init__(self, noise: Noise, joints: int) -> None:
        """noise: of `Imu`."""
        self._noise, self._edges = noise, np.cumsum([0, 3, 3, joints, joints, joints])
        self._block: np.ndarray | None = None  # of the noise, to which the parts belong
        self._parts: list[tuple[np.ndarray, ...]] = []

    def __call__(self) -> tuple[np.ndarray, ...]:
        noise = self._noise
        noise.draw()
        if self._block is not noise.rows:
            rows = np.empty((BLOCK, self._edges[-1]))
            views = (rows[:, a:b] for a, b in pairwise(self._edges))
            self._block, self._parts = noise.rows, list(zip(noise.rows, rows, *views, strict=True))
        noise.used += 1
        return self._parts[noise.used - 1]


@jit
def disturbed(
    rates: np.ndarray,
    specific_force: np.ndarray,
    noise: np.ndarray,
    bias: np.ndarray,
    gyro: np.ndarray,
    accelerometer: np.ndarray,
) -> None:
    """Write rates (3,) [rad/s] and specific force (3,) [m/s^2], FLU, plus noise and bias (6,).

    They are written to gyro (3,) and accelerometer (3,).
    """
    for i in range(3):
        gyro[i] = rates[i] + noise[i] + bias[i]
        accelerometer[i] = specific_force[i] + noise[3 + i] + bias[3 + i]


@jit
def noisy_pose(
    position: np.ndarray,
    quaternion: np.ndarray,
    noise: np.ndarray,
    place: np.ndarray,
    attitude: np.ndarray,
) -> None:
    """Write position (3,) [m] and quaternion (4,) [w x y z] with noise to place and attitude.

    noise (6,): added to the position [m], and a rotation vector in the body [rad].
    """
    for i in range(3):
        place[i] = position[i] + noise[i]
    turn = quaternion_from_rotation_vector(noise[3:])
    attitude[:] = quaternion_multiply(quaternion, turn)


@jit
def quantised(
    angle: np.ndarray,
    velocity: np.ndarray,
    units: np.ndarray,
    angles: np.ndarray,
    velocities: np.ndarray,
) -> None:
    """Write angle (n,) [rad] in whole counts to angles (n,), velocity (n,) [rad/s] in whole units
    to velocities (n,); units (2,): count [rad], unit of the velocity [rad/s]."""
    count, unit = units[0], units[1]
    for i in range(len(angle)):
        angles[i] = count * np.round(angle[i] / count)
        velocities[i] = unit * np.round(velocity[i] / unit)
