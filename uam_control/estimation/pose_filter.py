"""Pose filter: integrates the IMU and corrects with motion capture that arrives late.

A fixed-gain observer (what a Kalman filter with constant noise converges to). The pose in force
when the camera exposed is kept in a ring, so that the correction compares like with like.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.estimation.pose_gate import PoseGate
from uam_control.estimation.repeats import Repeats
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
    rotate,
    rotation_error,
)

HISTORY = 64  # ticks of pose kept, 256 ms at 250 Hz
OLDEST_MATCH = 0.02  # [s] a pose without a prediction this near is not used
LATE = 0.03  # [s] later than this, a pose corrects the predictions since, too
GRAVITY = 9.81
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


class PoseFilter:
    """Position, velocity, attitude and the biases of gyroscope and accelerometer.

    position, velocity (3,) world; quaternion [w x y z]; rates (3,) body, bias removed;
    acceleration (3,) world, gravity and bias removed; gyro_bias (3,) body; accelerometer_bias (3,)
    world.
    """

    def __init__(self, position_bandwidth: float, attitude_bandwidth: float, gate: float) -> None:
        """Bandwidths [rad/s] of the corrections from motion capture; gate [m]: see `PoseGate`."""
        self.gate = PoseGate(gate)
        self.set_bandwidths(position_bandwidth, attitude_bandwidth)
        self.position = np.zeros(3)
        self.velocity = np.zeros(3)
        self.quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        self.rates = np.zeros(3)
        self.acceleration = np.zeros(3)
        self.gyro_bias = np.zeros(3)
        self.accelerometer_bias = np.zeros(3)
        self._stamps = np.full(HISTORY, -1.0)
        self._poses = np.zeros((HISTORY, 7))
        self._count = 0
        self._last_correction = -1.0
        self._repeats = Repeats()

    def set_bandwidths(self, position: float, attitude: float) -> None:
        """Change the corrections; the estimate goes on."""
        self._bandwidths = np.array([position, attitude], dtype=float)

    def start(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Begin at rest at a measured pose."""
        self.position[:] = position
        self.quaternion[:] = quaternion

    def predict(
        self, stamp: float, dt: float, gyro: np.ndarray, specific_force: np.ndarray
    ) -> None:
        """Integrate one IMU sample over dt [s]; gyro [rad/s], specific force [m/s^2], FLU."""
        row = self._count % HISTORY
        self._count += 1
        self._stamps[row] = stamp
        predict(
            dt,
            gyro,
            specific_force,
            self.position,
            self.velocity,
            self.quaternion,
            self.rates,
            self.acceleration,
            self.gyro_bias,
            self.accelerometer_bias,
            self._poses[row],
        )

    def correct(self, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Correct with a pose exposed at `stamp`.

        Not used: one that is older than the history, one that repeats exactly what came before, see
        `Repeats`, and one that has jumped away, see `PoseGate`.
        """
        row = nearest(self._stamps, stamp)
        if abs(self._stamps[row] - stamp) > OLDEST_MATCH or self._repeats(position, quaternion):
            return
        off, bias = math.dist(position, self._poses[row, :3]), math.hypot(*self.accelerometer_bias)
        if self.gate(stamp, off, bias):
            return
        dt = min(max(stamp - self._last_correction, 1e-3), 0.05)
        self._last_correction = stamp
        since = self._stamps[(self._count - 1) % HISTORY] - self._stamps[row]
        if since > LATE:
            before = self.position.copy(), self.velocity.copy(), self.quaternion.copy()
        correct(
            dt,
            self._bandwidths,
            position,
            quaternion,
            self._poses[row],
            self.position,
            self.velocity,
            self.quaternion,
            self.gyro_bias,
            self.accelerometer_bias,
        )
        if since > LATE:
            self.position += since * (self.velocity - before[1])
            shift(
                self._stamps,
                self._poses,
                self._stamps[row],
                self.position - before[0],
                self.velocity - before[1],
                quaternion_multiply(before[2] * CONJUGATE, self.quaternion),
            )


@jit
def nearest(stamps: np.ndarray, stamp: float) -> int:
    """Return the row of the stamp nearest to `stamp`."""
    best = 0
    for row in range(len(stamps)):
        if abs(stamps[row] - stamp) < abs(stamps[best] - stamp):
            best = row
    return best


@jit
def shift(
    stamps: np.ndarray,
    poses: np.ndarray,
    since: float,
    displacement: np.ndarray,
    velocity: np.ndarray,
    turn: np.ndarray,
) -> None:
    """Correct the predictions from `since` [s] on, as what was found then would have changed them.

    Without it every pose under way would ask for the same correction again, and the observer rings.
    displacement (3,): of the newest one; velocity (3,): change at `since`; turn (4,): in the body.
    """
    newest = np.max(stamps)
    for row in range(len(stamps)):
        if stamps[row] >= since:
            for i in range(3):
                poses[row, i] += displacement[i] - (newest - stamps[row]) * velocity[i]
            poses[row, 3:] = quaternion_multiply(poses[row, 3:], turn)


@jit
def predict(
    dt: float,
    gyro: np.ndarray,
    specific_force: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    quaternion: np.ndarray,
    rates: np.ndarray,
    acceleration: np.ndarray,
    gyro_bias: np.ndarray,
    accelerometer_bias: np.ndarray,
    pose: np.ndarray,
) -> None:
    """Advance the pose by dt and write it, with its quaternion, into pose (7,)."""
    for i in range(3):
        rates[i] = gyro[i] - gyro_bias[i]
    turned = quaternion_multiply(quaternion, quaternion_from_rotation_vector(rates * dt))
    norm = np.sqrt(np.sum(turned * turned))
    quaternion[:] = turned / norm
    force = rotate(matrix_from_quaternion(quaternion), specific_force)
    force[2] -= GRAVITY
    for i in range(3):
        acceleration[i] = force[i] - accelerometer_bias[i]
        position[i] += dt * velocity[i] + 0.5 * dt * dt * acceleration[i]
        velocity[i] += dt * acceleration[i]
    pose[:3] = position
    pose[3:] = quaternion


@jit
def correct(
    dt: float,
    bandwidths: np.ndarray,
    measured_position: np.ndarray,
    measured_quaternion: np.ndarray,
    pose: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    quaternion: np.ndarray,
    gyro_bias: np.ndarray,
    accelerometer_bias: np.ndarray,
) -> None:
    """Observer gains 3w, 3w^2, w^3 (triple pole) for position, 2w, w^2 for attitude."""
    w = bandwidths[0]
    for i in range(3):
        innovation = measured_position[i] - pose[i]
        position[i] += 3.0 * w * dt * innovation
        velocity[i] += 3.0 * w * w * dt * innovation
        accelerometer_bias[i] -= w * w * w * dt * innovation
    w = bandwidths[1]
    error = rotation_error(measured_quaternion, pose[3:])
    quaternion[:] = quaternion_multiply(
        quaternion, quaternion_from_rotation_vector(2.0 * w * dt * error)
    )
    for i in range(3):
        gyro_bias[i] -= w * w * dt * error[i]
