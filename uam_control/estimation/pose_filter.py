"""Pose filter: integrates the IMU and corrects with delayed motion capture.

It is a fixed-gain observer, the steady state of a Kalman filter with constant noise. A ring buffer
stores the predicted poses, so that a measured pose is compared with the prediction at its exposure,
between two samples of the IMU, too. One that arrives before the IMU's sample waits for it.
"""

from __future__ import annotations

import math
from bisect import insort
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from uam_control.ages import AHEAD, AHEAD_FOR, BRIDGED
from uam_control.coordinates import Z
from uam_control.estimation.history import OLDEST_MATCH, value_at
from uam_control.estimation.pose_clock import PoseClock
from uam_control.estimation.pose_gate import PoseGate
from uam_control.estimation.repeats import Repeats
from uam_control.maths.compiled import jit, prepared
from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
    rotate,
    rotation_error,
)

HISTORY = 256  # stored predictions: BRIDGED at 250 Hz
LATE = 0.03  # s, delay above which a pose also corrects the later predictions
FIRST = 0.05  # s, interval that the first correction counts for
# bandwidth × interval between two poses, or between the two predictions around one: with sparser
# ones the bandwidth falls, or the observer would be unstable
LARGEST_GAIN = 0.3
LATE_SHARE = 0.2  # of a pose's lateness counts as such an interval: biases since then are not seen
TURN, POSE = 3, 7  # a stored pose: position before, quaternion from this index on; its numbers
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


class EstimatedMotion(NamedTuple):
    """The arrays of a `PoseFilter`; see there."""

    position: np.ndarray
    velocity: np.ndarray
    quaternion: np.ndarray
    rates: np.ndarray
    acceleration: np.ndarray
    gyro_bias: np.ndarray
    accelerometer_bias: np.ndarray


MOTION = 22  # numbers of an `EstimatedMotion`
# numbers of a filter's memory, see `parts_of`; the last POSE: the prediction that is compared
MEMORY = MOTION + (1 + POSE) * HISTORY + POSE


@jit
def parts_of(memory: np.ndarray) -> tuple[EstimatedMotion, np.ndarray, np.ndarray]:
    """Return motion, stamps (HISTORY,) [s] and poses (HISTORY, 7) of the stored predictions.

    They are views of memory (MEMORY,): a call passes one array instead of nine.
    """
    motion = EstimatedMotion(
        memory[0:3],
        memory[3:6],
        memory[6:10],
        memory[10:13],
        memory[13:16],
        memory[16:19],
        memory[19:MOTION],
    )
    poses = MOTION + HISTORY
    return motion, memory[MOTION:poses], memory[poses:-POSE].reshape((HISTORY, POSE))


def allowed_bandwidth(interval: float) -> float:
    """Return the largest bandwidth [rad/s] with a pose every `interval` [s]; larger ones act as
    this one."""
    return LARGEST_GAIN / interval


class PoseFilter:
    """Estimates position, velocity, attitude and the biases of gyroscope and accelerometer.

    position (3,) [m, world]; velocity (3,) [m/s, world]; quaternion (4,) body → world [w x y z];
    rates (3,) [rad/s, body], without bias; acceleration (3,) [m/s^2, world], without gravity and
    bias; gyro_bias (3,) [rad/s, body]; accelerometer_bias (3,) [m/s^2, world]. `motion`: all of
    them; `memory`: see `parts_of`. The arrays are never replaced.
    `ahead`: poses that wait for their IMU sample.
    """

    def __init__(
        self, position_bandwidth: float, attitude_bandwidth: float, gate: float, gravity: float
    ) -> None:
        """Bandwidths [rad/s] of the corrections from motion capture; gate [m]: see `PoseGate`;
        gravity [m/s^2]."""
        self.gravity = gravity
        self.gate = PoseGate(gate)
        self.set_bandwidths(position_bandwidth, attitude_bandwidth)
        self.memory = np.zeros(MEMORY)
        self.motion, self._stamps, self._poses = parts_of(self.memory)
        self.position, self.velocity, self.quaternion, self.rates = self.motion[:4]
        self.acceleration, self.gyro_bias, self.accelerometer_bias = self.motion[4:]
        self.quaternion[0] = 1.0
        self._stamps[:] = -math.inf
        self._count = 0
        self._last_correction: float | None = None  # stamp [s]
        self._compared = math.nan  # stamp [s] of the last prediction compared with a pose
        self._ahead_since = math.inf  # stamp [s] from which on a pose far ahead waits at any time
        self._clock_ahead = False  # whether the clock of the poses is wrong
        self.ahead: list[tuple[float, np.ndarray, np.ndarray]] = []  # in order of the stamps
        self._clock, self._repeats = PoseClock(), Repeats()
        memory, still = self.memory, np.zeros(3)
        self._predict = prepared(predict_next, memory, 0, 0.0, 0.0, 0.0, still, still)
        self._match = prepared(match_stored, memory, 0, 0.0, still)
        self._correct = prepared(correct_stored, memory, 0.0, self._bandwidths, still, np.zeros(4))

    def set_bandwidths(self, position: float, attitude: float) -> None:
        """Set the bandwidths [rad/s] of the corrections; the estimate does not change."""
        self._bandwidths = np.array([position, attitude], dtype=float)
        self._widest = max(position, attitude)

    def start(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Begin at rest at a measured pose: position (3,) [m, world], quaternion (4,) [w x y z]."""
        self.position[:] = position
        self.quaternion[:] = quaternion

    def predict(
        self, stamp: float, dt: float, gyro: np.ndarray, specific_force: np.ndarray
    ) -> None:
        """Integrate an IMU sample over dt [s].

        stamp [s]: of the sample; gyro (3,) [rad/s, FLU]; specific_force (3,) [m/s^2, FLU].
        """
        row = self.next_row()
        self._predict(self.memory, row, stamp, dt, self.gravity, gyro, specific_force)
        while self.ahead and self.ahead[0][0] <= stamp:
            self.correct(*self.ahead.pop(0))

    def next_row(self) -> int:
        """Return the row of the stored predictions for the next IMU sample."""
        row = self._count % HISTORY
        self._count += 1
        return row

    def correct(self, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Correct with a pose exposed at `stamp` [s].

        position (3,) [m, world]; quaternion (4,) body → world [w x y z]. A pose is ignored if it is
        older than the stored predictions, has a wrong clock (`PoseClock`), repeats the last pose
        exactly (`Repeats`), or has jumped away from the estimate (`PoseGate`). One that is newer
        than the newest prediction waits for the IMU. A stored prediction is compared with one pose:
        beside a gap of the IMU the same difference would count several times.
        """
        newest = (self._count - 1) % HISTORY
        last = self._stamps[newest]
        if stamp > last:
            if self._count and self._waits(stamp, last):
                if len(self.ahead) == HISTORY:
                    del self.ahead[0]
                insort(self.ahead, (stamp, position.copy(), quaternion.copy()), key=itemgetter(0))
            return
        compared, gap, jump, bias = self._match(self.memory, newest, stamp, position)
        if not self._clock(stamp, last, BRIDGED):
            self.gate.refused += 1
            return
        if abs(stamp - compared) > OLDEST_MATCH:
            return
        if self._repeats(position, quaternion) or compared == self._compared:
            return
        if self.gate(stamp, jump, bias):
            return
        bandwidths, dt = self._bandwidths, FIRST
        step = max(gap, LATE_SHARE * (last - compared))
        if self._last_correction is not None:
            dt = max(stamp - self._last_correction, 1e-3)
            step = max(dt, step)
        if step * self._widest > LARGEST_GAIN:
            bandwidths = np.minimum(bandwidths, allowed_bandwidth(step))
        self._last_correction, self._compared = stamp, compared
        since = last - compared
        if since > LATE:
            before = self.position.copy(), self.velocity.copy(), self.quaternion.copy()
        self._correct(self.memory, dt, bandwidths, position, quaternion)
        if since > LATE:
            self.position += since * (self.velocity - before[1])
            shift(
                self._stamps,
                self._poses,
                compared,
                self.position - before[0],
                self.velocity - before[1],
                quaternion_multiply(before[2] * CONJUGATE, self.quaternion),
            )

    def _waits(self, stamp: float, newest: float) -> bool:
        """Whether a pose of `stamp` waits for its IMU sample, newer than `newest` [s].

        Poses that are ahead while samples keep coming have a wrong clock: they would count late.
        """
        if stamp - newest <= AHEAD:
            self._clock_ahead, self._ahead_since = False, math.inf
        elif not self._clock_ahead:
            self._ahead_since = min(self._ahead_since, newest) if self.ahead else newest
            self._clock_ahead = newest - self._ahead_since > AHEAD_FOR
            if self._clock_ahead:
                self.ahead.clear()
        self.gate.refused += self._clock_ahead
        return not self._clock_ahead


@jit
def predict_next(
    memory: np.ndarray,
    row: int,
    stamp: float,
    dt: float,
    gravity: float,
    gyro: np.ndarray,
    specific_force: np.ndarray,
) -> None:
    """Integrate the IMU sample of `stamp` [s] in memory (MEMORY,), with its prediction in `row`.

    The other arguments: see `predict`.
    """
    motion, stamps, poses = parts_of(memory)
    stamps[row] = stamp
    predict(dt, gravity, gyro, specific_force, motion, poses, row)


@jit
def match_stored(
    memory: np.ndarray, newest: int, stamp: float, position: np.ndarray
) -> tuple[float, float, float, float]:
    """Find the prediction of `stamp` [s] in memory (MEMORY,) for `correct_stored`.

    newest: row of the newest prediction; position (3,) [m, world]: of the measured pose. Returns
    what `value_at` returns, the distance of the pose from the prediction [m], and the norm of the
    accelerometer bias [m/s^2].
    """
    motion, stamps, poses = parts_of(memory)
    predicted = memory[-POSE:]
    compared, gap = value_at(stamps, poses, newest, stamp, predicted)
    jump = bias = 0.0
    for i in range(3):
        jump += (position[i] - predicted[i]) ** 2
        bias += motion.accelerometer_bias[i] ** 2
    return compared, gap, math.sqrt(jump), math.sqrt(bias)


@jit
def correct_stored(
    memory: np.ndarray,
    dt: float,
    bandwidths: np.ndarray,
    position: np.ndarray,
    quaternion: np.ndarray,
) -> None:
    """Correct memory (MEMORY,) with a pose and the prediction of `match_stored`, see `correct`."""
    motion, _, _ = parts_of(memory)
    correct(dt, bandwidths, position, quaternion, memory[-POSE:], motion)


@jit
def shift(
    stamps: np.ndarray,
    poses: np.ndarray,
    since: float,
    displacement: np.ndarray,
    velocity: np.ndarray,
    turn: np.ndarray,
) -> None:
    """Apply the correction found for the stamp `since` [s] to all later predictions.

    Otherwise each delayed pose would cause the same correction again, and the observer would
    oscillate. stamps (m,) [s]; poses (m, 7): position and quaternion; displacement (3,) [m]: of the
    newest prediction; velocity (3,) [m/s]: change since `since`; turn (4,): rotation in the body.
    """
    newest = np.max(stamps)
    for row in range(len(stamps)):
        if stamps[row] >= since:
            for i in range(3):
                poses[row, i] += displacement[i] - (newest - stamps[row]) * velocity[i]
            poses[row, TURN:] = quaternion_multiply(poses[row, TURN:], turn)


@jit
def predict(
    dt: float,
    gravity: float,
    gyro: np.ndarray,
    specific_force: np.ndarray,
    motion: EstimatedMotion,
    poses: np.ndarray,
    row: int,
) -> None:
    """Advance the estimate in place by dt [s]; write position and quaternion into poses[row] (7,).

    gravity [m/s^2]; gyro (3,), specific_force (3,): see `PoseFilter.predict`.
    """
    position, velocity, quaternion, rates, acceleration, gyro_bias, accelerometer_bias = motion
    pose = poses[row]
    for i in range(3):
        rates[i] = gyro[i] - gyro_bias[i]
    turned = quaternion_multiply(quaternion, quaternion_from_rotation_vector(rates * dt))
    norm = np.sqrt(np.sum(turned * turned))
    quaternion[:] = turned / norm
    force = rotate(matrix_from_quaternion(quaternion), specific_force)
    force[Z] -= gravity
    for i in range(3):
        acceleration[i] = force[i] - accelerometer_bias[i]
        position[i] += dt * velocity[i] + 0.5 * dt * dt * acceleration[i]
        velocity[i] += dt * acceleration[i]
    pose[:TURN] = position
    pose[TURN:] = quaternion


@jit
def correct(
    dt: float,
    bandwidths: np.ndarray,
    measured_position: np.ndarray,
    measured_quaternion: np.ndarray,
    predicted: np.ndarray,
    motion: EstimatedMotion,
) -> None:
    """Correct the estimate in place with a measured pose and its prediction (7,).

    Observer gains: 3w, 3w^2, w^3 (triple pole) for position; 2w, w^2 (double pole) for attitude.
    dt [s]: since the last correction; bandwidths (2,): w of position and attitude [rad/s];
    measured_position (3,) [m, world]; measured_quaternion (4,) body → world [w x y z].
    """
    position, velocity, quaternion, _, _, gyro_bias, accelerometer_bias = motion
    w = bandwidths[0]
    for i in range(3):
        innovation = measured_position[i] - predicted[i]
        position[i] += 3.0 * w * dt * innovation
        velocity[i] += 3.0 * w * w * dt * innovation
        accelerometer_bias[i] -= w * w * w * dt * innovation
    w = bandwidths[1]
    error = rotation_error(measured_quaternion, predicted[TURN:])
    quaternion[:] = quaternion_multiply(
        quaternion, quaternion_from_rotation_vector(2.0 * w * dt * error)
    )
    for i in range(3):
        gyro_bias[i] -= w * w * dt * error[i]
