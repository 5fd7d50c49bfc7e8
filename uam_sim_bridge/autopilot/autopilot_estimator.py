"""Attitude, velocity and position for arming checks, telemetry and the failsafe descent.

A complementary filter replaces PX4's EKF2. It integrates gyro and accelerometer and is corrected
by the vision pose. Without vision, roll and pitch are corrected by the measured gravity, while
position and velocity drift. It serves a level descent, not precise flight: the control laws have
their own estimator.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.ages import UNAIDED
from uam_control.estimation.pose_filter import value_at
from uam_control.maths.compiled import jit, prepared
from uam_control.maths.memory import Number, record
from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
    rotate,
    rotation_error,
)

GRAVITY = 9.80665  # m/s^2, as PX4

# slices of `estimate` (10,): attitude FRD → NED [w x y z], position NED [m], velocity NED [m/s]
_PLACE, _SPEED, _END = 4, 7, 10
ATTITUDE, POSITION, VELOCITY = slice(_PLACE), slice(_PLACE, _SPEED), slice(_SPEED, _END)
DOWN = _END - 1  # of `estimate`: velocity downwards

HISTORY = 64  # samples of the estimate that are kept: FORWARDED at 250 Hz
ALIGN_SAMPLES = 5  # vision poses until the estimate is valid
MAX_TILT_DIFFERENCE = math.radians(10.0)  # between vision and measured gravity, at rest

_LEVEL_GAIN = 0.2  # 1/s, gravity → roll and pitch
_VISION_ATTITUDE = 5.0  # 1/s, vision → attitude
_VISION_POSITION = 20.0  # 1/s, vision → position
_VISION_VELOCITY = 100.0  # 1/s^2, position difference → velocity: two poles at -10 1/s
_VISION_BIAS = 50.0  # 1/s^3, position difference → bias: a third pole at -0.5 1/s
_BIAS_WINDOW = 0.02  # m, a larger difference is a jump of vision and does not change the bias
_BIAS_MAX = 0.4  # m/s^2
_LONGEST_PULL = 0.04  # s, longest interval used for the correction by one pose
_FORCE_TIME = 0.2  # s, time constant of the mean specific force
_VELOCITY_KEPT = 5.0  # s without vision, after which the next pose resets the velocity to 0
_REST_TIME = 0.2  # s, time constant of the bias of a vehicle that stands


class EstimatorArrays(NamedTuple):
    """The state of the filter. Without the bias a descent without vision would climb or fall."""

    estimate: np.ndarray  # (10,)
    bias: np.ndarray  # (3,) of the acceleration [m/s^2, NED], estimated from vision
    mean_force: np.ndarray  # (3,) [m/s^2, FRD] low-pass filtered, for the check before arming
    past: np.ndarray  # (HISTORY, 7) attitude and position of the last samples
    stamps: np.ndarray  # (HISTORY,) [s]
    vision_down: np.ndarray  # (3,) vertical axis of the newest pose, FRD
    numbers: np.ndarray  # (1,) row of the newest sample; number and time [s] of the vision poses


@jit
def predict(
    gyro: np.ndarray, accel: np.ndarray, time: float, dt: float, arrays: EstimatorArrays
) -> bool:
    """Advance the estimate by dt [s] to `time` [s]; return whether it is aided.

    gyro (3,) [rad/s] and specific force accel (3,) [m/s^2], FRD.
    """
    estimate, bias, mean_force, past, stamps, _, numbers = arrays
    aided = time - numbers[0].vision_time < UNAIDED
    newest = numbers[0].newest = (numbers[0].newest + 1) % HISTORY
    for i in range(3):
        mean_force[i] += min(1.0, dt / _FORCE_TIME) * (accel[i] - mean_force[i])
    matrix = matrix_from_quaternion(estimate[:_PLACE])
    force = rotate(matrix, accel)
    turn = np.empty(3)
    # expected direction of gravity in the body against the measured one: -accel at rest
    pull = 0.0
    norm = math.sqrt(accel[0] ** 2 + accel[1] ** 2 + accel[2] ** 2)
    if abs(norm - GRAVITY) < 1.0 and not aided:
        pull = _LEVEL_GAIN / norm
    down = matrix[2]
    turn[0] = dt * (gyro[0] + pull * (-accel[1] * down[2] + accel[2] * down[1]))
    turn[1] = dt * (gyro[1] + pull * (-accel[2] * down[0] + accel[0] * down[2]))
    turn[2] = dt * (gyro[2] + pull * (-accel[0] * down[1] + accel[1] * down[0]))
    q = quaternion_multiply(estimate[:_PLACE], quaternion_from_rotation_vector(turn))
    scale = 1.0 / math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    for i in range(4):
        estimate[i] = q[i] * scale
    for i in range(3):
        acceleration = force[i] - bias[i] + (GRAVITY if i == 2 else 0.0)
        estimate[_PLACE + i] += dt * (estimate[_SPEED + i] + 0.5 * dt * acceleration)
        estimate[_SPEED + i] += dt * acceleration
    for i in range(_SPEED):
        past[newest, i] = estimate[i]
    stamps[newest] = time
    return aided


@jit
def rest(dt: float, arrays: EstimatorArrays) -> None:
    """Correct by the knowledge that the vehicle stands, for dt [s]: no velocity, no acceleration.

    PX4's update of zero velocity. Without it the bias of a vehicle that takes off is unknown.
    """
    estimate, bias = arrays.estimate, arrays.bias
    force = rotate(matrix_from_quaternion(estimate[:_PLACE]), arrays.mean_force)
    for i in range(3):
        learnt = force[i] + (GRAVITY if i == 2 else 0.0) - bias[i]
        changed = bias[i] + min(1.0, dt / _REST_TIME) * learnt
        bias[i] = min(_BIAS_MAX, max(-_BIAS_MAX, changed))
        estimate[_SPEED + i] = 0.0


@jit
def correct(
    position: np.ndarray,
    quaternion: np.ndarray,
    interval: float,
    estimate: np.ndarray,
    bias: np.ndarray,
) -> None:
    """Correct estimate (10,) by a vision pose, `interval` [s] after the last one.

    position (3,) [m, NED]; quaternion (4,) [w x y z], FRD → NED; bias (3,): see `predict`.
    """
    interval = min(interval, _LONGEST_PULL)
    error = rotation_error(quaternion, estimate[:_PLACE])
    for i in range(3):
        error[i] *= _VISION_ATTITUDE * interval
    q = quaternion_multiply(estimate[:_PLACE], quaternion_from_rotation_vector(error))
    for i in range(4):
        estimate[i] = q[i]
    for i in range(3):
        difference = position[i] - estimate[_PLACE + i]
        estimate[_PLACE + i] += _VISION_POSITION * interval * difference
        estimate[_SPEED + i] += _VISION_VELOCITY * interval * difference
        if abs(difference) < _BIAS_WINDOW:
            learnt = bias[i] - _VISION_BIAS * interval * difference
            bias[i] = min(_BIAS_MAX, max(-_BIAS_MAX, learnt))


@jit
def fuse(
    position: np.ndarray, quaternion: np.ndarray, time: float, age: float, arrays: EstimatorArrays
) -> None:
    """Correct by a pose that arrives at `time` [s]; the first after a gap sets the estimate.

    position (3,) [m, NED]; quaternion (4,) [w x y z], FRD → NED; age [s]: the pose is compared
    with the estimate at time - age, as PX4's EKF2 fuses at its delayed horizon. The estimates
    since then are corrected, too: the next late pose shows what is left, not the same again.
    """
    m, exposed = arrays.numbers[0], time - age
    gap, m.vision_time = time - m.vision_time, time
    m.vision_count = 1 if gap > UNAIDED else m.vision_count + 1
    estimate, past, stamps = arrays.estimate, arrays.past, arrays.stamps
    before = estimate[_PLACE:].copy()
    if age != 0.0:
        position, quaternion = moved_on(exposed, position, quaternion, arrays)
    arrays.vision_down[:] = matrix_from_quaternion(quaternion)[2]
    if gap > UNAIDED:
        estimate[:_PLACE] = quaternion
        estimate[_PLACE:_SPEED] = position
        if gap > _VELOCITY_KEPT:
            estimate[_SPEED:] = 0.0
        return
    correct(position, quaternion, gap, estimate, arrays.bias)
    if age <= 0.0:
        return
    change = estimate[_PLACE:] - before  # of position and velocity
    for row in range(len(stamps)):
        if stamps[row] >= exposed:
            for i in range(3):
                past[row, _PLACE + i] += change[i] + (stamps[row] - exposed) * change[3 + i]
    for i in range(3):
        estimate[_PLACE + i] += age * change[3 + i]


@jit
def moved_on(
    exposed: float, position: np.ndarray, quaternion: np.ndarray, arrays: EstimatorArrays
) -> tuple[np.ndarray, np.ndarray]:
    """Return a pose of `exposed` [s], moved by the estimated motion since then."""
    now, stamps, then = arrays.estimate, arrays.stamps, np.empty(_SPEED)
    newest = np.argmax(stamps)
    value_at(stamps, arrays.past, newest, exposed, then)
    ahead = max(exposed - stamps[newest], 0.0)  # of the newest sample
    back = then[:_PLACE]
    for i in range(1, 4):
        back[i] = -back[i]
    moved = np.empty(3)
    for i in range(3):
        moved[i] = position[i] + now[_PLACE + i] - then[_PLACE + i] - ahead * now[_SPEED + i]
    return moved, quaternion_multiply(now[:_PLACE], quaternion_multiply(back, quaternion))


class Estimator:
    """The filter with the state of its vision input; NED and FRD throughout."""

    _vision_time, _vision_count = Number(), Number()

    def __init__(self) -> None:
        self.estimate = np.zeros(_END)  # attitude quaternion, position [m], velocity [m/s]
        self.estimate[0] = 1.0
        self.memory = record("newest vision_count", "vision_time")
        self._vision_time = -math.inf
        past = np.zeros((HISTORY, _SPEED))
        past[:, 0] = 1.0  # level before the first sample
        self.arrays = EstimatorArrays(
            *(self.estimate, np.zeros(3), np.zeros(3), past, np.full(HISTORY, -math.inf)),
            *(np.array([0.0, 0.0, 1.0]), self.memory),
        )
        still = np.zeros(3)
        self._fuse = prepared(fuse, still, still, 0.0, 0.0, self.arrays)
        self._predict = prepared(predict, still, still, 0.0, 0.0, self.arrays)
        self._rest = prepared(rest, 0.0, self.arrays)

    def aided(self, time: float) -> bool:
        """Whether the last vision pose is younger than UNAIDED at `time` [s]."""
        return time - self._vision_time < UNAIDED

    def unaided_for(self, time: float) -> float:
        """Return the time [s] since the last vision pose at `time` [s]."""
        return time - self._vision_time

    def stands(self, dt: float) -> None:
        """Correct by the knowledge that the vehicle stands; dt [s]."""
        self._rest(dt, self.arrays)

    def predict(self, time: float, gyro: np.ndarray, accel: np.ndarray, dt: float) -> bool:
        """See `predict`."""
        return self._predict(gyro, accel, time, dt, self.arrays)

    def vision(
        self, time: float, position: np.ndarray, quaternion: np.ndarray, age: float = 0.0
    ) -> None:
        """See `fuse`."""
        self._fuse(position, quaternion, time, age, self.arrays)

    def faults(self, time: float) -> list[str]:
        """Return the reasons against arming in PX4's wording; empty if the estimate is valid."""
        if not self.aided(time):
            return ["Preflight Fail: no valid vision pose (external vision missing)"]
        if self._vision_count < ALIGN_SAMPLES:
            return ["Preflight Fail: attitude estimate not aligned yet"]
        force, down = self.arrays.mean_force, self.arrays.vision_down
        norm = float(np.linalg.norm(force))
        if not 0.8 * GRAVITY < norm < 1.2 * GRAVITY:
            return [f"Preflight Fail: accelerometer reads {norm:.1f} m/s^2 at rest"]
        cosine = float(-force @ down) / norm
        if cosine < math.cos(MAX_TILT_DIFFERENCE):
            angle = math.degrees(math.acos(max(-1.0, cosine)))
            return [f"Preflight Fail: vision tilt differs from gravity by {angle:.0f} deg"]
        return []
