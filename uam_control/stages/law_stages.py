"""Stage: an adaptive law, and the ticks at which its gains are published."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from uam_control.control.controllers import AttitudeController, Controller
from uam_control.stages.timing import Timing
from uam_control.stamps import SECOND

REPORT_DELAY = 200_000_000  # [ns] after which a report of a tick has arrived at every stage
GAINS_PERIOD = 20_000_000  # [ns] between two publications of the adapted gains


class MeasuredDelay:
    """The loop delay that the bridge reports, for the attitude law of a later tick.

    A report is used when it has arrived in every engine, REPORT_DELAY after its stamp.
    `reports`: those that have not, the stamp [ns] and the loop delay [s] of each.
    """

    def __init__(self, controller: AttitudeController) -> None:
        self._controller = controller
        self.reports: deque[tuple[int, float]] = deque()

    def report(self, stamp: int, loop_delay: float | None) -> None:
        """Take the report of the tick `stamp` [ns]; loop_delay [s], None: unknown."""
        if self.reports and stamp < self.reports[-1][0]:  # a new simulation
            self.reports.clear()
        self.reports.append((stamp, math.nan if loop_delay is None else loop_delay))

    def apply(self, stamp: int) -> None:
        """Give the controller the newest report that has arrived at the tick `stamp` [ns]."""
        while self.reports and self.reports[0][0] <= stamp - REPORT_DELAY:
            self._controller.measured(self.reports.popleft()[1])


class LawStage:
    """One controller and its time steps.

    `gains_due`: whether to publish the adapted gains of the last tick, for the recording and the
    supervisor.
    """

    def __init__(self, controller: Controller, timing: Timing) -> None:
        self.controller = controller
        self.gains_due = False
        self._period = timing.period  # [ns]
        self._reported = range(GAINS_PERIOD)  # stamps [ns] of the period of the last tick
        self._last: int | None = None  # [ns] last tick

    def update(self, stamp: int, *inputs: np.ndarray | bool) -> np.ndarray:
        """Return tau of the controller at the tick `stamp` [ns].

        inputs: those of the controller's `update`, without dt. dt is the time since the last tick;
        one control period at the first tick, after a gap of more than ten periods and after a step
        back in time: the laws must not integrate over a time without samples.
        """
        last, self._last = self._last, stamp
        self.gains_due = stamp not in self._reported
        if self.gains_due:
            begin = stamp // GAINS_PERIOD * GAINS_PERIOD
            self._reported = range(begin, begin + GAINS_PERIOD)
        step = self._period if last is None else stamp - last
        if not 0 < step <= 10 * self._period:
            step = self._period
        return self.controller.update(*inputs, step / SECOND)
