"""A line without hardware: its level is the content of a file, 0 or 1, for tests and rehearsals.

What is behind the line reads the file; a fault writes or removes it.
"""

from __future__ import annotations

import os
from pathlib import Path


class FileLine:
    """Has the methods of `drivers.magnet.gpio_line.Line`."""

    def __init__(self, file: Path, active_low: bool = False) -> None:
        """active_low: on is the level 0. Raises OSError."""
        self._file, self._active_low = file, active_low
        self._level(False)

    def set(self, on: bool) -> None:
        """Switch; raises OSError if the file is gone."""
        os.stat(self._file)
        self._level(on)

    def read(self) -> bool:
        """Return the state; raises OSError if the file is gone."""
        return (self._file.read_text(encoding="utf-8") == "1") is not self._active_low

    def close(self) -> None:
        """Nothing to give back: the level stays."""

    def _level(self, on: bool) -> None:
        """Write the level in one step: a reader never sees an empty file."""
        fresh = self._file.with_name(self._file.name + ".new")
        fresh.write_text("1" if on is not self._active_low else "0", encoding="utf-8")
        os.replace(fresh, self._file)
