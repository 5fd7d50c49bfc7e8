"""Outputs with two states that a gripper hangs on, by kind, and the magnet on one.

A new kind is a class and an entry.

The kind is the first word of the parameter `chip`: `simulated:FILE`; a path alone is a GPIO chip.
"""

import math
import os
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

from uam_control.settings.parameter_set import ParameterSet, choice, integer, number, switch, text
from uam_sim_bridge.devices import INSTALL

HOLD, RELEASE = "hold", "release"  # no "off", which YAML reads as false


try:
    import gpiod
    from gpiod.line import Direction, Value
except ImportError:
    gpiod = None

CONSUMER = "uam magnet"  # name by which `gpioinfo` shows the user of the line


class MagnetError(ValueError):
    """A line that cannot be used; the text is one line."""


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


class Line(ABC):
    """An output, off from the beginning. Each method raises OSError if the line is lost.

    Made with the text behind the kind, `line` and `active_low` of `LineParameters`; raises
    MagnetError.
    """

    @abstractmethod
    def set(self, on: bool) -> None:
        """Switch."""

    @abstractmethod
    def read(self) -> bool:
        """Return the state as read back from the line."""

    @abstractmethod
    def close(self) -> None:
        """Give the line back; it keeps its state only if the hardware does so."""


class GpioLine(Line):
    """A line of a GPIO chip, by the package `gpiod` (libgpiod 2, Linux' character device)."""

    def __init__(self, chip: str, number: int = 0, active_low: bool = False) -> None:
        """chip: its device; active_low: on is a low level. Raises MagnetError."""
        if gpiod is None:
            raise MagnetError(f"chip: the package gpiod is missing: {INSTALL}")
        settings = gpiod.LineSettings(
            direction=Direction.OUTPUT, active_low=active_low, output_value=Value.INACTIVE
        )
        self._number = number
        try:
            self._lines = gpiod.request_lines(chip, consumer=CONSUMER, config={number: settings})
        except FileNotFoundError:
            raise MagnetError(f"chip: {chip} does not exist; `gpiodetect` lists them") from None
        except PermissionError:
            raise MagnetError(
                f"chip: {chip} may not be opened; add the user to its group (`ls -l {chip}`)"
            ) from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise MagnetError(
                f"line: {number} of {chip}: {reason}; `gpioinfo` shows lines and who uses them"
            ) from None

    def set(self, on: bool) -> None:
        self._lines.set_value(self._number, Value.ACTIVE if on else Value.INACTIVE)

    def read(self) -> bool:
        return self._lines.get_value(self._number) is Value.ACTIVE

    def close(self) -> None:
        self._lines.release()


class FileLine(Line):
    """A line without hardware: its level is the content of a file, 0 or 1.

    For tests and rehearsals. What is behind the line reads the file; a fault writes or removes it.
    """

    def __init__(self, chip: str, number: int = 0, active_low: bool = False) -> None:
        """chip: the file; active_low: on is the level 0. Raises MagnetError."""
        self._file, self._active_low = Path(chip), active_low
        try:
            self._level(False)
        except OSError as error:
            raise MagnetError(f"chip: {chip}: {error.strerror or error}") from None

    def set(self, on: bool) -> None:
        """See `Line`; the file must still be there."""
        os.stat(self._file)
        self._level(on)

    def read(self) -> bool:
        return (self._file.read_text(encoding="utf-8") == "1") is not self._active_low

    def close(self) -> None:
        """See `Line`; the level stays."""

    def _level(self, on: bool) -> None:
        """Write the level in one step: a reader never sees an empty file."""
        fresh = self._file.with_name(self._file.name + ".new")
        fresh.write_text("1" if on is not self._active_low else "0", encoding="utf-8")
        os.replace(fresh, self._file)


GPIO = "gpio"
LINES: dict[str, type[Line]] = {GPIO: GpioLine, "simulated": FileLine}


def open_line(parameters: LineParameters) -> Line:
    """Open the line, switched off; raises MagnetError."""
    kind, _, rest = parameters.chip.partition(":")
    if kind not in LINES:
        kind, rest = GPIO, parameters.chip
    return LINES[kind](rest, parameters.line, parameters.active_low)


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
