"""Sensor models: rate, noise, bias, quantisation and latency; the noise is seeded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.memory import Flag, Number, put, record
from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
)

BLOCK = 256  # noise samples drawn per call of the generator; the sequence is the same for any


class NoiseArrays(NamedTuple):
    """rows (BLOCK, width): the present block of a `Noise`; numbers (1,): how many are used."""

    rows: np.ndarray
    numbers: np.ndarray


class Noise:
    """White noise with given standard deviations (width,), drawn in blocks; (width,) per call.

    `arrays`: never replaced; compiled functions take a row by `next_row` after `draw`.
    """

    used = Number()

    def __init__(
        self,
        generator: np.random.Generator,
        deviations: np.ndarray,
        kind: str = "standard_normal",
    ) -> None:
        """kind: method of the generator; its numbers are multiplied by deviations (width,)."""
        self._drawn, self.deviations = getattr(generator, kind), np.array(deviations, dtype=float)
        self.memory = record("used")
        self.used = BLOCK
        self.arrays = NoiseArrays(np.zeros((BLOCK, len(deviations))), self.memory)

    def __call__(self) -> np.ndarray:
        self.draw()
        self.used += 1
        return self.arrays.rows[self.used - 1].copy()

    def draw(self, least: int = 1) -> int:
        """Draw new rows if less than `least` are left; return how many are left."""
        left = BLOCK - self.used
        if left < least:
            rows = self.arrays.rows
            rows[:left] = rows[self.used :]
            rows[left:] = self._drawn((self.used, rows.shape[1])) * self.deviations
            self.used = 0
        return BLOCK - self.used


@borrowing
def next_row(noise: NoiseArrays) -> int:
    """Use the next row of a noise; return its number."""
    m = noise.numbers[0]
    m.used += 1
    return m.used - 1


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


class MocapArrays(NamedTuple):
    """Of a `Mocap`; due, poses: of those that have not arrived, in rings."""

    noise: NoiseArrays
    payload_noise: NoiseArrays
    taken: np.ndarray  # (2, POSE) newest pose of vehicle and payload, see `take_pose`
    due: np.ndarray  # (2, WAITING) [ticks]
    poses: np.ndarray  # (2, WAITING, POSE)
    first: np.ndarray  # (2,) of the rings
    count: np.ndarray  # (2,) of the rings
    arrived: np.ndarray  # (2,) how many at this tick, the rows before first
    grip: np.ndarray  # (3,) [m] the payload's
    numbers: np.ndarray  # (1,) see REAL


POSE = 8  # stamp [s], position (3,) [m, ENU], quaternion (4,) [w x y z], FLU → ENU
VEHICLE_POSE, PAYLOAD_POSE = range(2)
WAITING = 512  # poses that have not arrived, at most: of two seconds
# tracks: the payload, too; ticks: usual delay. next [s]: time of the next pose; payload_top [m]:
# height of the grip point over the payload's middle
WHOLE, REAL = "tracks ticks", "period next payload_top"


class Mocap:
    """OptiTrack: poses of vehicle and payload at its own rate. No pose overtakes another.

    `arrays`: never replaced, for `take_pose`, `send_pose`, `receive_poses`; `tracks`, `ticks`,
    `period`: see WHOLE, REAL.
    """

    tracks, ticks, period = Flag(), Number(), Number()

    def __init__(
        self,
        numbers: dict,
        scale: float,
        noises: Sequence[np.random.Generator],
        payload_top: float = 0.0,
    ) -> None:
        """numbers: `sensors.mocap` of the vehicle; scale: factor on noise; noises: of vehicle and
        payload; payload_top [m]: see REAL."""
        deviations = [numbers["position_noise"]] * 3 + [numbers["attitude_noise"]] * 3
        self.noises = [Noise(one, scale * np.array(deviations)) for one in noises]
        self.memory = record(WHOLE, REAL)
        tracks, ticks = numbers.get("payload", False), numbers.get("latency_ticks", 0)
        self.memory[0] = tracks, ticks, 1.0 / numbers["rate"], 0.0, payload_top
        self.arrays = MocapArrays(
            *(noise.arrays for noise in self.noises),
            np.zeros((2, POSE)),
            np.zeros((2, WAITING), dtype=np.int64),
            np.zeros((2, WAITING, POSE)),
            *np.zeros((3, 2), dtype=np.int64),
            np.zeros(3),
            self.memory,
        )

    def feed(self, rate: float, ticks: int, deviations: Sequence[float]) -> None:
        """Change rate [Hz], delay [ticks] and noise (2,): of position [m] and attitude [rad]."""
        self.period, self.ticks = 1.0 / rate, ticks
        for noise in self.noises:
            noise.deviations[:] = np.repeat(deviations, 3)

    def draw(self, tick: float) -> int:
        """Draw noise; return for how many ticks of `tick` [s] it is left."""
        in_a_tick = math.ceil(tick / self.period)
        left = min(noise.draw(in_a_tick) for noise in self.noises)
        return max(1, int((left - in_a_tick) * self.period / tick))

    def arrived(self, body: int) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Return stamp [s], position, quaternion of the poses that arrive at this tick."""
        a = self.arrays
        rows = range(a.first[body] - a.arrived[body], a.first[body])
        return [_parts(a.poses[body, row % WAITING]) for row in rows]


def _parts(pose: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    pose = pose.copy()
    return pose.item(0), pose[1:4], pose[4:POSE]


@borrowing
def take_pose(
    a: MocapArrays,
    time: float,
    tick: float,
    position: np.ndarray,
    quaternion: np.ndarray,
    velocity: np.ndarray,
    rates: np.ndarray,
    payload: np.ndarray,
) -> bool:
    """Take the next pose if it is due at `time` [s], with noise; return whether it is.

    tick [s]: since the last call at another time. A pose is of the tick at which it is taken; where
    several are due in a tick, each is of its own time. position, velocity (3,), quaternion (4,),
    rates (3,): of the vehicle; payload (7,): position and quaternion.
    """
    m = a.numbers[0]
    if time + 1e-9 < m.next:
        return False
    if time > m.next + max(m.period, tick):  # the first tick of a plant that begins later
        m.next = time
    ago = time - m.next if m.period < tick else 0.0
    m.next += m.period
    taken = a.taken[VEHICLE_POSE]
    taken[0], noise = time - ago, a.noise.rows[next_row(a.noise)]
    noisy_pose(position, quaternion, noise, taken[1:4], taken[4:POSE])
    if ago > 0.0:
        turn_back(taken, ago, velocity, rates)
    if m.tracks:
        taken = a.taken[PAYLOAD_POSE]
        taken[0], noise = time, a.payload_noise.rows[next_row(a.payload_noise)]
        write_grip(payload, m.payload_top, a.grip)
        noisy_pose(a.grip, payload[3:7], noise, taken[1:4], taken[4:POSE])
    return True


@jit
def turn_back(pose: np.ndarray, ago: float, velocity: np.ndarray, rates: np.ndarray) -> None:
    """Change a pose (POSE,) to that of a time `ago` [s] before, at constant velocities (3,)."""
    for i in range(3):
        pose[1 + i] -= ago * velocity[i]
    turn = quaternion_from_rotation_vector(-ago * rates)
    pose[4:POSE] = quaternion_multiply(pose[4:POSE], turn)


@borrowing
def send_pose(a: MocapArrays, body: int, due: int) -> None:
    """Let a newest pose, VEHICLE_POSE or PAYLOAD_POSE, arrive at the tick `due`."""
    row = (a.first[body] + a.count[body]) % WAITING
    a.due[body, row] = due
    put(a.taken[body], a.poses[body, row])
    a.count[body] += 1


@borrowing
def receive_poses(a: MocapArrays, tick: int) -> None:
    """Write how many poses arrive at `tick`."""
    for body in range(2):
        a.arrived[body] = 0
        while a.count[body] and a.due[body, a.first[body]] <= tick:
            a.arrived[body] += 1
            a.first[body] = (a.first[body] + 1) % WAITING
            a.count[body] -= 1


def encoder_units(numbers: dict) -> np.ndarray:
    """Return the steps (2,) of a Dynamixel's position [rad] and velocity [rad/s].

    numbers: `sensors.joints` of the vehicle.
    """
    return np.array([2.0 * np.pi / numbers["counts_per_turn"], numbers["velocity_unit"]])


@borrowing
def disturbed(
    rates: np.ndarray,
    specific_force: np.ndarray,
    noise: np.ndarray,
    bias: np.ndarray,
    gyro: np.ndarray,
    accelerometer: np.ndarray,
) -> None:
    """Write rates (3,) [rad/s] and specific force (3,) [m/s^2], FLU, plus noise and bias (6,), to
    gyro (3,) and accelerometer (3,)."""
    for i in range(3):
        gyro[i] = rates[i] + noise[i] + bias[i]
        accelerometer[i] = specific_force[i] + noise[3 + i] + bias[3 + i]


@jit
def write_grip(pose: np.ndarray, height: float, point: np.ndarray) -> None:
    """Write the point (3,) [m, world] at `height` [m] on the vertical axis of a body.

    pose (7,): position [m] and quaternion [w x y z] of the body.
    """
    matrix = matrix_from_quaternion(pose[3:])
    for i in range(3):
        point[i] = pose[i] + height * matrix[i, 2]


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


@borrowing
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
