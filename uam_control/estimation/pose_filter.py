"""Pose filter: integrates the IMU and corrects with delayed motion capture.

It is a fixed-gain observer, the steady state of a Kalman filter with constant noise. A ring buffer
stores the predicted poses, so that a measured pose is compared with the prediction at its exposure,
between two samples of the IMU, too. One that arrives before the IMU's sample waits for it.
"""

import math
from typing import NamedTuple

import numpy as np

from uam_control.ages import BRIDGED, FORWARDED, REJECTED, REJECTED_LATE
from uam_control.coordinates import Z
from uam_control.estimation.pose_clock import (
    counts,
    forget_clock,
    forget_rejections,
    new_clock,
    new_gate,
    no_pose,
    rejects,
    repeated,
    waits,
)
from uam_control.maths.compiled import jit
from uam_control.maths.memory import record
from uam_control.maths.rotations import (
    CONJUGATE,
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
    rotate,
    rotation_error,
)

OLDEST_MATCH = 0.02  # s, largest distance in time between a sample and a value it is compared with
SAME = 1e-6  # s, between stamps of the same moment: the unit of MAVLink
HISTORY = 256  # stored predictions: BRIDGED at 250 Hz
LATE = 0.03  # s, delay above which a pose also corrects the later predictions
FIRST = 0.05  # s, interval that the first correction counts for
# bandwidth × interval between two poses, or between the two predictions around one: with sparser
# ones the bandwidth falls, or the observer would be unstable
LARGEST_GAIN = 0.3
LATE_SHARE = 0.2  # of a pose's lateness counts as such an interval: biases since then are not seen
TURN, POSE = 3, 7  # a stored pose: position before, quaternion from this index on; its numbers


class EstimatedMotion(NamedTuple):
    """What a filter estimates."""

    position: np.ndarray  # (3,) [m, world]
    velocity: np.ndarray  # (3,) [m/s, world]
    quaternion: np.ndarray  # (4,) body → world [w x y z]
    rates: np.ndarray  # (3,) [rad/s, body] without bias
    acceleration: np.ndarray  # (3,) [m/s^2, world] without gravity and bias
    gyro_bias: np.ndarray  # (3,) [rad/s, body]
    accelerometer_bias: np.ndarray  # (3,) [m/s^2, world]


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


class FilterArrays(NamedTuple):
    """State of a filter; all arrays stay."""

    memory: np.ndarray  # see `parts_of`
    bandwidths: np.ndarray  # (3,) [rad/s] of position and attitude, the larger of both
    used: np.ndarray  # (2,) [rad/s] in this correction
    ahead: np.ndarray  # (HISTORY, 8) stamp and pose: they wait for their IMU sample, in order
    newest: np.ndarray  # (7,) see `repeated`
    clock: np.ndarray  # (1,) of `pose_clock`
    gate: np.ndarray  # (1,) of `pose_clock`
    numbers: np.ndarray  # (1,) WHOLE, REAL


# count: of the IMU samples; waiting: number of poses ahead. Stamps [s], NaN before the first:
# last_correction: of the pose; compared: of the last prediction compared with a pose
WHOLE, REAL = "count waiting", "last_correction compared gravity"


def filter_arrays() -> FilterArrays:
    """Return the state of a filter that begins; its parameters are zero."""
    made = FilterArrays(
        *(np.zeros(MEMORY), np.zeros(3), np.zeros(2), np.zeros((HISTORY, 1 + POSE))),
        *(no_pose(), new_clock(), new_gate(), record(WHOLE, REAL)),
    )
    begin_anew(made)
    return made


@jit
def begin_anew(a: FilterArrays) -> None:
    """Forget all samples: level and at rest; parameters stay."""
    m = a.numbers[0]
    motion, stamps, _ = parts_of(a.memory)
    m.count = m.waiting = 0
    m.last_correction = m.compared = math.nan
    a.memory[:] = 0.0
    motion.quaternion[0] = 1.0
    stamps[:] = -math.inf
    a.newest[:] = math.nan
    forget_clock(a.clock)
    forget_rejections(a.gate)


@jit
def predict_next(
    a: FilterArrays, stamp: float, dt: float, gyro: np.ndarray, specific_force: np.ndarray
) -> None:
    """Integrate an IMU sample over dt [s], between the poses that wait: before it and up to it.

    stamp [s]: of the sample; gyro (3,) [rad/s, FLU]; specific_force (3,) [m/s^2, FLU].
    """
    correct_waiting(a)
    m = a.numbers[0]
    row = m.count % HISTORY
    m.count += 1
    parts_of(a.memory)[1][row] = stamp
    predict(a, dt, gyro, specific_force, row)
    correct_waiting(a)


@jit
def newest_stamp(a: FilterArrays) -> float:
    """Return the stamp [s] of the newest prediction, -inf before the first."""
    return parts_of(a.memory)[1][(a.numbers[0].count - 1) % HISTORY]


@jit
def correct_waiting(a: FilterArrays) -> None:
    """Correct with the poses that wait, in the order of their stamps, up to the newest prediction's
    stamp."""
    m = a.numbers[0]
    newest = newest_stamp(a)
    while m.waiting and a.ahead[0, 0] <= newest:
        at, pose = a.ahead[0, 0], a.ahead[0, 1:].copy()
        m.waiting = drop_first(a.ahead, m.waiting)
        correct_stored(a, at, pose[:TURN], pose[TURN:])


@jit
def wait(a: FilterArrays, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> None:
    """Let a pose exposed at `stamp` [s] wait for `correct_waiting`.

    position (3,) [m, world]; quaternion (4,) body → world [w x y z]. A pose is ignored if it is
    older than the stored predictions, has a wrong clock (`counts`), repeats the last pose exactly
    (`repeated`), or has jumped away from the estimate (`rejects`). One that is newer
    than the newest prediction waits for the IMU. A stored prediction is compared with one pose:
    beside a gap of the IMU the same difference would count several times.
    """
    m, newest = a.numbers[0], newest_stamp(a)
    if not m.count:
        return
    if not waits(a.clock, stamp, newest):
        while m.waiting and a.ahead[m.waiting - 1, 0] > newest:
            m.waiting -= 1
        a.gate[0].refused += 1
        return
    m.waiting = insert(a.ahead, m.waiting, stamp, position, quaternion)


@jit
def correct_stored(
    a: FilterArrays, stamp: float, position: np.ndarray, quaternion: np.ndarray
) -> None:
    """Correct with a pose that has its prediction, see `wait`."""
    m = a.numbers[0]
    motion, stamps, poses = parts_of(a.memory)
    newest, predicted = (m.count - 1) % HISTORY, a.memory[-POSE:]
    last = stamps[newest]
    compared, gap = value_at(stamps, poses, newest, stamp, predicted)
    if not counts(a.clock, stamp, last, BRIDGED):
        a.gate[0].refused += 1
        return
    if abs(stamp - compared) > OLDEST_MATCH:
        return
    if repeated(position, quaternion, a.newest) or compared == m.compared:
        return
    jump = bias = 0.0
    for i in range(3):
        jump += (position[i] - predicted[i]) ** 2
        bias += motion.accelerometer_bias[i] ** 2
    # late poses: the estimate without them is less certain than they are
    longest = REJECTED if last - stamp <= FORWARDED else REJECTED_LATE
    if rejects(a.gate, stamp, math.sqrt(jump), math.sqrt(bias), longest):
        return
    since, dt = last - compared, FIRST
    step = max(gap, LATE_SHARE * since)
    if not math.isnan(m.last_correction):
        dt = max(stamp - m.last_correction, 1e-3)
        step = max(dt, step)
    capped = step * a.bandwidths[2] > LARGEST_GAIN
    for i in range(2):
        a.used[i] = min(a.bandwidths[i], LARGEST_GAIN / step) if capped else a.bandwidths[i]
    m.last_correction, m.compared = stamp, compared
    if since > LATE:
        correct_late(a, since, dt, position, quaternion)
    else:
        correct(a, dt, position, quaternion)


@jit
def correct_late(
    a: FilterArrays, since: float, dt: float, position: np.ndarray, quaternion: np.ndarray
) -> None:
    """Correct as `correct` does, and what was predicted in the `since` [s] after the exposure."""
    motion, _, _ = parts_of(a.memory)
    place, speed, turn = motion.position.copy(), motion.velocity.copy(), motion.quaternion.copy()
    correct(a, dt, position, quaternion)
    for i in range(3):
        motion.position[i] += since * (motion.velocity[i] - speed[i])
    turn = quaternion_multiply(turn * CONJUGATE, motion.quaternion)
    shift(a, motion.position - place, motion.velocity - speed, turn)


@jit
def shift(
    a: FilterArrays, displacement: np.ndarray, velocity: np.ndarray, turn: np.ndarray
) -> None:
    """Apply the correction found for the prediction that was compared to all later ones.

    Otherwise each delayed pose would cause the same correction again, and the observer would
    oscillate. displacement (3,) [m]: of the newest prediction; velocity (3,) [m/s]: change since
    that one; turn (4,): rotation in the body.
    """
    _, stamps, poses = parts_of(a.memory)
    newest, since = np.max(stamps), a.numbers[0].compared
    for row in range(len(stamps)):
        if stamps[row] >= since:
            for i in range(3):
                poses[row, i] += displacement[i] - (newest - stamps[row]) * velocity[i]
            poses[row, TURN:] = quaternion_multiply(poses[row, TURN:], turn)


@jit
def predict(
    a: FilterArrays, dt: float, gyro: np.ndarray, specific_force: np.ndarray, row: int
) -> None:
    """Advance the estimate by dt [s], see `predict_next`; store its pose in a row."""
    motion, _, poses = parts_of(a.memory)
    position, velocity, quaternion, rates, acceleration, gyro_bias, accelerometer_bias = motion
    pose = poses[row]
    for i in range(3):
        rates[i] = gyro[i] - gyro_bias[i]
    turned = quaternion_multiply(quaternion, quaternion_from_rotation_vector(rates * dt))
    norm = np.sqrt(np.sum(turned * turned))
    quaternion[:] = turned / norm
    force = rotate(matrix_from_quaternion(quaternion), specific_force)
    force[Z] -= a.numbers[0].gravity
    for i in range(3):
        acceleration[i] = force[i] - accelerometer_bias[i]
        position[i] += dt * velocity[i] + 0.5 * dt * dt * acceleration[i]
        velocity[i] += dt * acceleration[i]
    pose[:TURN] = position
    pose[TURN:] = quaternion


@jit
def correct(
    a: FilterArrays, dt: float, measured_position: np.ndarray, measured_quaternion: np.ndarray
) -> None:
    """Correct the estimate with a measured pose, see `wait`, by the prediction that is compared.

    Observer gains: 3w, 3w^2, w^3 (triple pole) for position; 2w, w^2 (double pole) for attitude,
    with the bandwidths w in use. dt [s]: since the last correction.
    """
    motion, _, _ = parts_of(a.memory)
    position, velocity, quaternion, _, _, gyro_bias, accelerometer_bias = motion
    predicted, w = a.memory[-POSE:], a.used[0]
    for i in range(3):
        innovation = measured_position[i] - predicted[i]
        position[i] += 3.0 * w * dt * innovation
        velocity[i] += 3.0 * w * w * dt * innovation
        accelerometer_bias[i] -= w * w * w * dt * innovation
    w = a.used[1]
    error = rotation_error(measured_quaternion, predicted[TURN:])
    quaternion[:] = quaternion_multiply(
        quaternion, quaternion_from_rotation_vector(2.0 * w * dt * error)
    )
    for i in range(3):
        gyro_bias[i] -= w * w * dt * error[i]


@jit
def insert(
    queue: np.ndarray, count: int, stamp: float, first: np.ndarray, second: np.ndarray
) -> int:
    """Let a sample of `stamp` [s] wait among `count`; return how many wait.

    queue (m, w): in a row the stamp of a sample and its two vectors; w = 1 + len(first) +
    len(second). Equal stamps stay in order of arrival. If full, it forgets its oldest.
    """
    if count == len(queue):
        count = drop_first(queue, count)
    place, middle = count, 1 + len(first)
    while place and queue[place - 1, 0] > stamp:
        queue[place] = queue[place - 1]
        place -= 1
    queue[place, 0] = stamp
    queue[place, 1:middle] = first
    queue[place, middle:] = second
    return count + 1


@jit
def drop_first(queue: np.ndarray, count: int) -> int:
    """Forget the oldest of the `count` samples that wait; return how many are left."""
    for i in range(1, count):
        queue[i - 1] = queue[i]
    return count - 1


@jit
def value_at(
    stamps: np.ndarray, rows: np.ndarray, newest: int, stamp: float, found: np.ndarray
) -> tuple[float, float]:
    """Write the value of `stamp` [s] into found (w,), linear between the two rows around it.

    stamps (m,) [s], rows (m, w): a ring, written up to `newest`. Next to a gap of more than twice
    OLDEST_MATCH, and outside the ring, the nearest row counts. Returns the stamp of the value [s],
    and the time [s] between the two rows, 0 for the value of one row.
    """
    before = newest
    for _ in range(len(stamps) - 1):
        if stamps[before] <= stamp:
            break
        before = (before - 1) % len(stamps)
    after = before if before == newest else (before + 1) % len(stamps)
    gap, since = stamps[after] - stamps[before], stamp - stamps[before]
    if SAME < since < gap - SAME and gap <= 2.0 * OLDEST_MATCH:
        share = since / gap
        for i in range(len(found)):
            found[i] = rows[before, i] + share * (rows[after, i] - rows[before, i])
        return stamp, gap
    nearest = after if abs(stamps[after] - stamp) < abs(since) else before
    for i in range(len(found)):
        found[i] = rows[nearest, i]
    return stamps[nearest], 0.0
