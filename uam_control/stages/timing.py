"""The control period."""

from dataclasses import dataclass

from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.stamps import SECOND


@dataclass(frozen=True)
class Timing(ParameterSet):
    """Parameters of the control ticks."""

    control_period: float = number(0.004, "time between two control ticks", "s", 1e-4, 0.1)

    @property
    def period(self) -> int:
        """The control period [ns]."""
        return round(self.control_period * SECOND)
