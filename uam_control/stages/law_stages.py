"""Stage: an adaptive law, and the ticks at which its gains are published."""

from __future__ import annotations

import numpy as np

from uam_control.control.controllers import Controller
from uam_control.stages.timing import Timing
from uam_control.stamps import SECOND

GAINS_PERIOD = 20_000_000  # [ns] between two publications of the adapted gains


class LawStage:
    """One controller and its time steps.

    `gains_due`: whether to publish the adapted gains of the last tick, for the recording and the
    supervisor.
    """

    def __init__(self, controller: Controller, timing: Timing) -> None:
        self.controller = controller
        self.gains_due = False
        self._period = timing.period  # [ns]
        self._last: int | None = None  # [ns] last tick

    def update(self, stamp: int, *inputs: np.ndarray | bool) -> np.ndarray:
        """Return tau of the controller at the tick `stamp` [ns].

        inputs: those of the controller's `update`, without dt. dt is the time since the last tick;
        one control period at the first tick, after a gap of more than ten periods and after a step
        back in time: the laws must not integrate over a time without samples.
        """
        last, self._last = self._last, stamp
        self.gains_due = stamp // GAINS_PERIOD != (last or 0) // GAINS_PERIOD
        step = self._period if last is None else stamp - last
        if not 0 < step <= 10 * self._period:
            step = self._period
        return self.controller.update(*inputs, step / SECOND)
