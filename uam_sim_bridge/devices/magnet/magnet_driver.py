"""The magnet on a line: switches, reads back, and says what is wrong."""

from __future__ import annotations

from dataclasses import dataclass

from uam_control.settings.parameter_set import ParameterSet, integer, switch, text
from uam_sim_bridge.devices.magnet.gpio_line import Line


@dataclass(frozen=True)
class LineParameters(ParameterSet):
    """Which line; it cannot change while the node runs."""

    chip: str = text(
        "/dev/gpiochip0",
        "GPIO chip of the magnet's line",
        "its device, or simulated:FILE for a line without hardware",
    )
    line: int = integer(17, "number of the line on the chip", 0, 1023)
    active_low: bool = switch(False, "on is a low level at the line")


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
