"""Stage: motion capture + IMU + joints → state."""

from __future__ import annotations

import numpy as np

from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.stages.tick_stamps import TickStamps
from uam_control.stamps import SECOND


class EstimatorStage:
    """Takes samples as they arrive and returns the state at each IMU sample.

    All stamps are in [ns]. The IMU sample starts a tick; the other samples of the tick come before.
    `ticks`: the stamps of the ticks, see `TickStamps`.
    """

    def __init__(self, parameters: EstimatorParameters, joints: int, period: float) -> None:
        """joints: number of joints of the arm; period [s]: of the control ticks."""
        self.estimator = StateEstimator(parameters, joints)
        self.ticks = TickStamps(round(period * SECOND))
        self._waiting = True  # for the first sample of an input

    @property
    def stamp(self) -> int:
        """Return the stamp [ns] of the newest tick."""
        return self.ticks.stamp

    def mocap(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Take a pose: position (3,) [m, ENU], unit quaternion (4,) [w x y z], FLU → ENU."""
        self.estimator.mocap(stamp / SECOND, position, quaternion)

    def joints(self, stamp: int, alpha: np.ndarray, alpha_dot: np.ndarray) -> None:
        """Take joint readings: alpha (n,) [rad], alpha_dot (n,) [rad/s]."""
        self.estimator.joints(stamp / SECOND, alpha, alpha_dot)

    def imu(self, stamp: int, gyro: np.ndarray, force: np.ndarray) -> np.ndarray | None:
        """Take an IMU sample: gyro (3,) [rad/s], specific force (3,) [m/s^2], FLU.

        Returns the state (3, 6 + n) of the tick `stamp`, see `coordinates`; the next call reuses
        the array. Returns None until every input has arrived once, and for a repeated sample.
        Raises ValueError if the stamp is older than the last one.
        """
        before = self.ticks.repeated
        if not self.ticks.follows(stamp):
            if self.ticks.repeated > before:
                return None
            raise ValueError(f"IMU stamp {stamp} ns does not follow {self.stamp} ns")
        estimator = self.estimator
        estimator.imu(self.ticks.next(stamp) / SECOND, gyro, force)
        self._waiting = self._waiting and bool(estimator.waiting_for)
        return None if self._waiting else estimator.update()
