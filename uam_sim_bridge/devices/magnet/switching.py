"""Which state the magnet shall have: as commanded, and what holds without commands and at exit."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uam_control.settings.parameter_set import ParameterSet, choice, number

HOLD, RELEASE = "hold", "release"  # no "off", which YAML reads as false


@dataclass(frozen=True)
class SwitchingParameters(ParameterSet):
    """What happens without commands. A payload that is dropped may be worse than one that stays."""

    magnet_stale_after: float = number(
        1.0,
        "time without a command on /uam/magnet after which they count as lost",
        "s",
        0.1,
        60,
    )
    magnet_when_stale: str = choice(
        HOLD, "commands are lost: hold the last state, or release the payload", (HOLD, RELEASE)
    )
    magnet_at_exit: str = choice(
        RELEASE, "the node ends: release the payload, or hold the last state", (RELEASE, HOLD)
    )


class MagnetSwitching:
    """The desired state; off before the first command. Times [s] of one clock."""

    def __init__(self, parameters: SwitchingParameters) -> None:
        self._parameters = parameters
        self._on = False
        self._commanded = math.inf  # [s] last command, inf before the first

    def command(self, time: float, on: bool) -> None:
        """Take a command that arrived at `time`."""
        self._on, self._commanded = on, time

    def stale(self, time: float) -> bool:
        """Return whether commands came and stopped."""
        return time - self._commanded > self._parameters.magnet_stale_after

    def desired(self, time: float) -> bool:
        """Return the state that the magnet shall have at `time`.

        After a loss that switched it off, the next command counts again.
        """
        if self.stale(time) and self._parameters.magnet_when_stale == RELEASE:
            return False
        return self._on

    def at_exit(self) -> bool:
        """Return the state in which the magnet is left; it follows the last command."""
        return self._on and self._parameters.magnet_at_exit == HOLD
