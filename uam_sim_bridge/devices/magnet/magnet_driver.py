"""The magnet on a line: which state it shall have, with and without commands; what is wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uam_control.settings.parameter_set import ParameterSet, choice, number
from uam_sim_bridge.devices.magnet.lines import Line

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


class MagnetDriver:
    """`state`: as read back, None while the line is lost; `switched`: number of changes."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self.state: bool | None = None
        self.switched = 0
        self.problem = ""

    def update(self, desired: bool) -> None:
        """Switch if the line has not the desired state, and read it back."""
        try:
            if self.state is not desired:
                self._line.set(desired)
                self.switched += 1
            self.state = self._line.read()
        except OSError as error:
            self.state = None
            self.problem = f"the line is lost: {error.strerror or error}"
            return
        self.problem = ""
        if self.state is not desired:
            self.problem = (
                f"the line is {_word(self.state)} although it was switched {_word(desired)}"
            )

    def end(self, state: bool) -> None:
        """Leave the magnet in `state` and give the line back."""
        try:
            self._line.set(state)
        except OSError:  # the line is lost already: nothing is left to switch
            pass
        self._line.close()


def _word(on: bool) -> str:
    return "on" if on else "off"
