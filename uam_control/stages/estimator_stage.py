"""Stage: motion capture + IMU + joints → state."""

import math
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ALPHA, CHI_DDOT
from uam_control.estimation import StateEstimator, catalogue
from uam_control.estimation.base import BaseParameters
from uam_control.estimation.estimator import (
    EstimatorArrays,
    arrays_of,
    assemble,
    bias_known,
    complete,
    forget_samples,
    settle,
    take_imu,
    take_joints,
    take_mocap,
)
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Known, Number, record
from uam_control.stages.tick_stamps import TickStamps, follows, next_stamp
from uam_control.stamps import SECOND

MEMORY = 100  # poses
HELD_BACK = 1_000_000_000  # [ns] without a state after the estimate has diverged
# [m, rad, m/s, rad/s] largest believable entry of chi and chi_dot; no vehicle of a room reaches it
BELIEVABLE = 1e3
BIAS_PERIOD = 20_000_000  # [ns] between two publications of the estimated biases
# what a tick gives; OLDER: its stamp does not follow; DIVERGED: NONE, and the estimate begins anew
STATE, NONE, OLDER, DIVERGED = range(4)


class PoseAge:
    """Age of poses at their arrival: stamp of the tick in which one arrives − its exposure.

    `average` [ns]: low-pass over MEMORY poses, None before the first; `largest` [ns]: since
    `restart`.
    """

    average, largest = Known(), Number()

    def __init__(self) -> None:
        # arrived [ns]: stamp of a pose that has come since the last tick, -1: none
        self.memory = record("arrived largest", "average")
        self.memory[0] = -1, 0, math.nan

    def pose(self, exposed: int) -> None:
        """Take the stamp [ns] of a pose that has arrived."""
        self.memory["arrived"] = exposed

    def restart(self) -> None:
        """Begin a new period of `largest`."""
        self.largest = 0


@borrowing
def age_at(age: np.ndarray, stamp: int) -> None:
    """Take the stamp [ns] of a tick; age (1,): memory of a `PoseAge`."""
    m = age[0]
    if m.arrived < 0:
        return
    now = stamp - m.arrived
    m.arrived = -1
    m.average = now if math.isnan(m.average) else m.average + (now - m.average) / MEMORY
    m.largest = max(m.largest, now)


class StageArrays(NamedTuple):
    """State of an `EstimatorStage`."""

    estimator: EstimatorArrays
    ticks: np.ndarray  # (1,) of the stamps
    window: np.ndarray  # of the stamps
    age: np.ndarray  # (1,) of its poses
    numbers: np.ndarray  # (1,) waiting: for the first sample of an input; see the stage


class EstimatorStage:
    """Takes samples as they arrive and returns the state at each IMU sample.

    All stamps are in [ns]. The IMU sample starts a tick; the other samples of the tick come before.
    `bias_due`: whether to publish the estimated biases of the IMU after this tick, see
    `StateEstimator.bias_known`; `diverged`: how often the estimate has, which then begins anew;
    `held_until` [ns]: without states since then.
    """

    bias_due, diverged, held_until = Number(), Number(), Number()

    def __init__(self, parameters: BaseParameters, joints: int, period: float) -> None:
        """joints: number of joints of the arm; period [s]: of the control ticks."""
        self.estimator = catalogue.estimator(parameters.estimator)(parameters, joints)
        self.ticks = TickStamps(round(period * SECOND))
        self.pose_age = PoseAge()
        self.memory = record("bias_due diverged held_until waiting")
        self.memory["waiting"] = True
        self._share(joints)

    def _share(self, joints: int) -> None:
        """Make `arrays`, and the functions of this stage on them."""
        self.arrays = a = StageArrays(self.estimator.arrays, *self._own)  # never replaced
        self.state, *_ = arrays_of(a.estimator.memory)  # (3, 6 + n) of the newest tick
        sample, angles = np.zeros(3), np.zeros(joints)
        self.mocap = bound(take_pose, a, 0, sample, np.zeros(4))
        self.joints = bound(take_readings, a, 0, angles, angles)
        self._sample = bound(take_sample, a, 0, sample, sample)

    @property
    def _own(self) -> tuple[np.ndarray, ...]:
        return self.ticks.memory, self.ticks.window, self.pose_age.memory, self.memory

    @property
    def stamp(self) -> int:
        """Return the stamp [ns] of the newest tick."""
        return self.ticks.stamp

    @property
    def held_back(self) -> bool:
        """Return whether no states come because the estimate has diverged."""
        return self.diverged > 0 and self.stamp < self.held_until

    def imu(self, stamp: int, gyro: np.ndarray, force: np.ndarray) -> np.ndarray | None:
        """Take an IMU sample: see `take_sample`.

        Returns the state (3, 6 + n) of the tick `stamp`, see `coordinates`; the next call reuses
        the array. Raises ValueError if the stamp is older than the last one.
        """
        found = self._sample(stamp, gyro, force)
        if found == OLDER:
            raise ValueError(f"IMU stamp {stamp} ns does not follow {self.stamp} ns")
        return self.state if found == STATE else None


class PlainEstimatorStage(EstimatorStage):
    """The stage with an estimator in Python, after `Estimator`: its decisions are the same."""

    def _share(self, joints: int) -> None:
        self.arrays = StageArrays(self.memory, *self._own)  # without those of the estimator
        self.state = np.zeros((3, ALPHA + joints))
        self._begin = bound(begin_sample, self.arrays, 0)
        self._judge = bound(judge, self.arrays, self.state)

    def mocap(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        self.pose_age.pose(stamp)
        self.estimator.mocap(stamp / SECOND, position, quaternion)

    def joints(self, stamp: int, alpha: np.ndarray, alpha_dot: np.ndarray) -> None:
        self.estimator.joints(stamp / SECOND, alpha, alpha_dot)

    def _sample(self, stamp: int, gyro: np.ndarray, force: np.ndarray) -> int:
        estimator, begun = self.estimator, self._begin(stamp)
        if begun != STATE:
            return begun
        self.bias_due = self.bias_due and estimator.bias_known
        estimator.imu(self.stamp / SECOND, gyro, force)
        if not estimator.complete:
            return NONE
        self.state[:] = estimator.update()
        judged = self._judge(self.state)
        if judged == DIVERGED:
            estimator.forget()
        return judged


def estimator_stage(parameters: BaseParameters, joints: int, period: float) -> EstimatorStage:
    """Return the stage of the estimator that the parameters choose; see `EstimatorStage`."""
    compiled = catalogue.estimator(parameters.estimator) is StateEstimator
    return (EstimatorStage if compiled else PlainEstimatorStage)(parameters, joints, period)


@borrowing
def take_pose(a: StageArrays, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
    """Take a pose: position (3,) [m, ENU], unit quaternion (4,) [w x y z], FLU → ENU."""
    a.age[0].arrived = stamp
    take_mocap(a.estimator, stamp / SECOND, position, quaternion)


@borrowing
def take_readings(a: StageArrays, stamp: int, alpha: np.ndarray, alpha_dot: np.ndarray) -> None:
    """Take joint readings: alpha (n,) [rad], alpha_dot (n,) [rad/s]."""
    take_joints(a.estimator, stamp / SECOND, alpha, alpha_dot)


@borrowing
def take_sample(a: StageArrays, stamp: int, gyro: np.ndarray, force: np.ndarray) -> int:
    """Take an IMU sample, which starts a tick: gyro (3,) [rad/s], specific force (3,) [m/s^2], FLU.

    Returns STATE; OLDER; or NONE until every input has arrived once, for a repeated sample, and for
    HELD_BACK after a state that is not finite or not believable: whoever flies by the state
    then reacts as to an estimator that is gone.
    """
    begun = begin_sample(a, stamp)
    if begun != STATE:
        return begun
    m, tick = a.numbers[0], a.ticks[0].stamp
    settle(a.estimator)
    m.bias_due = m.bias_due and bias_known(a.estimator)
    take_imu(a.estimator, tick / SECOND, gyro, force)
    if m.waiting:
        m.waiting = not complete(a.estimator)
        if m.waiting:
            return NONE
    assemble(a.estimator)
    judged = judge(a, arrays_of(a.estimator.memory)[0])
    if judged == DIVERGED:
        m.waiting = True
        forget_samples(a.estimator)
    return judged


@borrowing
def begin_sample(a: StageArrays, stamp: int) -> int:
    """Begin the tick of an IMU sample: STATE if it is one, else see `take_sample`."""
    m, ticks = a.numbers[0], a.ticks[0]
    before, last = ticks.repeated, ticks.stamp
    if not follows(a.ticks, stamp):
        return NONE if ticks.repeated > before else OLDER
    tick = next_stamp(a.ticks, a.window, stamp)
    m.bias_due = tick // BIAS_PERIOD != last // BIAS_PERIOD
    age_at(a.age, tick)
    return STATE


@borrowing
def judge(a: StageArrays, state: np.ndarray) -> int:
    """Return whether the state (3, 6 + n) of the tick is given: STATE, NONE or DIVERGED."""
    m, tick = a.numbers[0], a.ticks[0].stamp
    if not believable(state):
        m.diverged += 1
        m.held_until = tick + HELD_BACK
        return DIVERGED
    return NONE if tick < m.held_until else STATE


@jit
def believable(state: np.ndarray) -> bool:
    """Return whether the state (3, 6 + n) is finite, and chi and chi_dot within BELIEVABLE."""
    for i in range(state.shape[1]):
        for j in range(CHI_DDOT):
            if not abs(state[j, i]) < BELIEVABLE:
                return False
        if not math.isfinite(state[CHI_DDOT, i]):
            return False
    return True
