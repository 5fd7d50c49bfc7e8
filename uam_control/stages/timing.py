"""The control period, and time steps from stamp to stamp."""

from __future__ import annotations

from dataclasses import dataclass

from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.stamps import SECOND, seconds


@dataclass(frozen=True)
class Timing(ParameterSet):
    """Parameters of the control ticks."""

    control_period: float = number(0.004, "time between two control ticks", "s", 1e-4, 0.1)


class Ticks:
    """Turns stamps into time steps. `period` [ns]: of control ticks."""

    def __init__(self, timing: Timing) -> None:
        self.period = round(timing.control_period * SECOND)
        self._step = seconds(self.period)
        self._last: int | None = None

    def step(self, stamp: int) -> float:
        """Return the time since the last tick [s].

        Returns one control period at the first tick, after a gap of more than ten periods and after
        a step back in time: the laws must not integrate over a time without samples.
        """
        last, self._last = self._last, stamp
        if last is None or not 0 < stamp - last <= 10 * self.period:
            return self._step
        return seconds(stamp - last)
