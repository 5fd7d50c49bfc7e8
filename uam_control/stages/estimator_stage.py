"""Stage: motion capture + IMU + joints → state."""

from __future__ import annotations

import math

import numpy as np

from uam_control.coordinates import ALPHA, CHI_DDOT
from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.maths.compiled import jit, prepared
from uam_control.stages.tick_stamps import TickStamps
from uam_control.stamps import SECOND

MEMORY = 100  # poses
HELD_BACK = 1_000_000_000  # [ns] without a state after the estimate has diverged
# [m, rad, m/s, rad/s] largest believable entry of chi and chi_dot; no vehicle of a room reaches it
BELIEVABLE = 1e3
BIAS_PERIOD = 20_000_000  # [ns] between two publications of the estimated biases


class PoseAge:
    """Age of poses at their arrival: stamp of the tick in which one arrives − its exposure.

    `mean` [ns]: low-pass over MEMORY poses, None before the first; `largest` [ns]: since `restart`.
    """

    def __init__(self) -> None:
        self.mean: float | None = None
        self.largest = 0
        self._arrived: int | None = None

    def pose(self, exposed: int) -> None:
        """Take the stamp [ns] of a pose that has arrived."""
        self._arrived = exposed

    def tick(self, stamp: int) -> None:
        """Take the stamp [ns] of a tick."""
        if self._arrived is None:
            return
        age, self._arrived = stamp - self._arrived, None
        self.mean = age if self.mean is None else self.mean + (age - self.mean) / MEMORY
        self.largest = max(self.largest, age)

    def restart(self) -> None:
        """Begin a new period of `largest`."""
        self.largest = 0


class EstimatorStage:
    """Takes samples as they arrive and returns the state at each IMU sample.

    All stamps are in [ns]. The IMU sample starts a tick; the other samples of the tick come before.
    `ticks`: the stamps of the ticks, see `TickStamps`; `pose_age`: of the poses at their arrival;
    `bias_due`: whether to publish the estimated biases of the IMU after this tick, see
    `StateEstimator.bias_known`; `diverged`: how often the estimate has, which then begins anew.
    """

    def __init__(self, parameters: EstimatorParameters, joints: int, period: float) -> None:
        """joints: number of joints of the arm; period [s]: of the control ticks."""
        self.estimator = StateEstimator(parameters, joints)
        self._joint_count = joints
        self.diverged = 0
        self._held_until = 0  # [ns]
        self.ticks = TickStamps(round(period * SECOND))
        self.pose_age = PoseAge()
        self.bias_due = False
        self._believable = prepared(believable, np.zeros((3, ALPHA + joints)))
        self._waiting = True  # for the first sample of an input

    @property
    def stamp(self) -> int:
        """Return the stamp [ns] of the newest tick."""
        return self.ticks.stamp

    @property
    def held_back(self) -> bool:
        """Return whether no states come because the estimate has diverged."""
        return self.diverged > 0 and self.stamp < self._held_until

    def set_parameters(self, parameters: EstimatorParameters) -> None:
        """Use `parameters` (validated) from the next sample on."""
        self.estimator.set_parameters(parameters)

    def mocap(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Take a pose: position (3,) [m, ENU], unit quaternion (4,) [w x y z], FLU → ENU."""
        self.pose_age.pose(stamp)
        self.estimator.mocap(stamp / SECOND, position, quaternion)

    def joints(self, stamp: int, alpha: np.ndarray, alpha_dot: np.ndarray) -> None:
        """Take joint readings: alpha (n,) [rad], alpha_dot (n,) [rad/s]."""
        self.estimator.joints(stamp / SECOND, alpha, alpha_dot)

    def imu(self, stamp: int, gyro: np.ndarray, force: np.ndarray) -> np.ndarray | None:
        """Take an IMU sample: gyro (3,) [rad/s], specific force (3,) [m/s^2], FLU.

        Returns the state (3, 6 + n) of the tick `stamp`, see `coordinates`; the next call reuses
        the array. Returns None until every input has arrived once, for a repeated sample, and for
        HELD_BACK after a state that is not finite or not believable: whoever flies by the state
        then reacts as to an estimator that is gone.
        Raises ValueError if the stamp is older than the last one.
        """
        estimator, ticks = self.estimator, self.ticks
        before = ticks.repeated
        if not ticks.follows(stamp):
            if ticks.repeated > before:
                return None
            raise ValueError(f"IMU stamp {stamp} ns does not follow {self.stamp} ns")
        last, tick = ticks.stamp, ticks.next(stamp)
        self.bias_due = tick // BIAS_PERIOD != last // BIAS_PERIOD and estimator.bias_known
        self.pose_age.tick(tick)
        if not self._waiting:
            state = estimator.imu_update(tick / SECOND, gyro, force)
        else:
            estimator.imu(tick / SECOND, gyro, force)
            self._waiting = bool(estimator.waiting_for)
            if self._waiting:
                return None
            state = estimator.update()
        if not self._believable(state):
            self.diverge(tick)
            return None
        return None if tick < self._held_until else state

    def diverge(self, tick: int) -> None:
        """Begin the estimate anew: that of the tick `tick` [ns] is not believable."""
        self.diverged += 1
        self._held_until = tick + HELD_BACK
        self.estimator = StateEstimator(self.estimator.parameters, self._joint_count)
        self._waiting = True


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
