"""Stage: an adaptive law, and the ticks at which its gains are published."""

from __future__ import annotations

import numpy as np

from uam_control.control.controllers import Controller
from uam_control.stages.timing import Ticks, Timing

GAINS_PERIOD = 20_000_000  # [ns] between two publications of the adapted gains


class LawStage:
    """One controller and its time steps.

    `gains_due`: whether to publish the adapted gains of the last tick, for the recording and the
    supervisor.
    """

    def __init__(self, controller: Controller, timing: Timing) -> None:
        self.controller = controller
        self.gains_due = False
        self._ticks = Ticks(timing)
        self._period = 0  # number of the gains' period that the last tick was in

    def update(self, stamp: int, *inputs: np.ndarray | bool) -> np.ndarray:
        """Return tau of the controller at the tick `stamp` [ns].

        inputs: those of the controller's `update`, without dt.
        """
        period = stamp // GAINS_PERIOD
        self.gains_due = period != self._period
        self._period = period
        return self.controller.update(*inputs, self._ticks.step(stamp))
