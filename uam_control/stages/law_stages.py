"""Stages: the three adaptive laws, and the ticks at which their gains are published."""

from __future__ import annotations

import numpy as np

from uam_control.control.controllers import (
    ArmController,
    AttitudeController,
    Controller,
    PositionController,
)
from uam_control.stages.timing import Ticks, Timing

GAINS_PERIOD = 20_000_000  # [ns] between two publications of the adapted gains


class LawStage:
    """One controller and its time steps.

    `gains_due`: whether to publish the adapted gains of the last tick, for the recording and the
    supervisor. Stamps are in [ns].
    """

    def __init__(self, controller: Controller, timing: Timing) -> None:
        self.controller = controller
        self.gains_due = False
        self._ticks = Ticks(timing)
        self._period = 0  # number of the gains' period that the last tick was in

    def _step(self, stamp: int) -> float:
        """Start the tick `stamp` and return its time step [s]."""
        period = stamp // GAINS_PERIOD
        self.gains_due = period != self._period
        self._period = period
        return self._ticks.step(stamp)


class PositionStage(LawStage):
    """state + reference → tau_p, eq. (8a), and the desired attitude."""

    controller: PositionController

    def update(
        self, stamp: int, state: np.ndarray, reference: np.ndarray, flying: bool
    ) -> np.ndarray:
        """Return tau_p (3,) [N, ENU]; zero while not flying.

        state, reference: (3, 6 + n), see `coordinates`.
        """
        return self.controller.update(state, reference, flying, self._step(stamp))

    @property
    def attitude_reference(self) -> np.ndarray:
        """Rows q_d [rad], Omega_d, Omega_d_dot (3, 3) of the last tick; see `AttitudeReference`."""
        return self.controller.attitude_reference


class TorqueStage(LawStage):
    """state + reference + attitude reference → tau_q, eq. (18a), or tau_alpha, eq. (25a)."""

    controller: AttitudeController | ArmController

    def update(
        self,
        stamp: int,
        state: np.ndarray,
        reference: np.ndarray,
        attitude_reference: np.ndarray,
        flying: bool,
    ) -> np.ndarray:
        """Return tau_q (3,) [N m, FLU] or tau_alpha (n,) [N m].

        state, reference: (3, 6 + n), see `coordinates`; attitude_reference: (3, 3) of the position
        law, same tick, see `AttitudeReference`.
        """
        return self.controller.update(
            state, reference, attitude_reference, flying, self._step(stamp)
        )
