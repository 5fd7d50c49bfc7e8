"""A GPIO line as an output, by the package `gpiod` (libgpiod 2, Linux' character device)."""

from __future__ import annotations

from typing import Protocol

try:
    import gpiod
    from gpiod.line import Direction, Value
except ImportError:
    gpiod = None

CONSUMER = "uam magnet"  # name by which `gpioinfo` shows the user of the line


class MagnetError(ValueError):
    """A line that cannot be used; the text is one line."""


class Line(Protocol):
    """An output with two states. Each method raises OSError if the line is lost."""

    def set(self, on: bool) -> None:
        """Switch."""
        ...

    def read(self) -> bool:
        """Return the state as read back from the line."""
        ...

    def close(self) -> None:
        """Give the line back; it keeps its state only if the hardware does so."""
        ...


class GpioLine:
    """A line of a GPIO chip; off from the beginning."""

    def __init__(self, chip: str, number: int, active_low: bool) -> None:
        """chip: its device; active_low: on is a low level. Raises MagnetError."""
        if gpiod is None:
            raise MagnetError(
                "chip: the package gpiod is missing: pip install -e '.[hardware]' in a clone; "
                "colcon: docs/first_flight.md"
            )
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
        """Switch; raises OSError."""
        self._lines.set_value(self._number, Value.ACTIVE if on else Value.INACTIVE)

    def read(self) -> bool:
        """Return the state as read back; raises OSError."""
        return self._lines.get_value(self._number) is Value.ACTIVE

    def close(self) -> None:
        """Give the line back."""
        self._lines.release()
