"""Processes of their own for tests of the compilation cache, forked from one that has numba.

A Python process that imports numba takes more than a second; a fork of one that has it, none.
"""

from __future__ import annotations

import importlib
import multiprocessing
import sys
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["uam_control.maths.compiled"])


class FreshProcess:
    """A process that has imported `module` of `folder`, and calls its functions."""

    def __init__(self, folder: Path, module: str) -> None:
        self._pipe, other = _CONTEXT.Pipe()
        self._process = _CONTEXT.Process(target=_serve, args=(str(folder), module, other))
        self._process.start()
        other.close()
        assert self._pipe.recv() == "ready"

    def begin(self, function: str, *arguments: Any) -> None:
        """Call a function there without waiting for it."""
        self._pipe.send((function, arguments))

    def answer(self) -> Any:
        """Return what the function returned."""
        return self._pipe.recv()

    def call(self, function: str, *arguments: Any) -> Any:
        """Call a function there and return what it returns."""
        self.begin(function, *arguments)
        return self.answer()

    def end(self) -> None:
        """End the process."""
        self._pipe.close()
        self._process.join()


def _serve(folder: str, name: str, pipe: Connection) -> None:
    sys.path.insert(0, folder)
    sys.dont_write_bytecode = True  # two versions of a file within a second look alike to Python
    module = importlib.import_module(name)
    pipe.send("ready")
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            return
        pipe.send(getattr(module, function)(*arguments))
