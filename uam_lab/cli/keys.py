"""Single keys of a terminal, without Enter."""

import os
import select
import sys
import termios
import tty
from typing import Self


class Keys:
    """Context in which single keys are read; nothing is read where stdin is no terminal."""

    def __init__(self) -> None:
        self._before: list | None = None

    @property
    def available(self) -> bool:
        """Return whether keys can be read."""
        return self._before is not None

    def __enter__(self) -> Self:
        """Switch the terminal to single keys; Ctrl-C still interrupts."""
        if sys.stdin.isatty():
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._before is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def pressed(self) -> str:
        """Return the next key that was pressed, "" for none."""
        if self._before is None or not select.select([sys.stdin], [], [], 0.0)[0]:
            return ""
        return os.read(sys.stdin.fileno(), 1).decode(errors="ignore")  # not the buffer of stdin
