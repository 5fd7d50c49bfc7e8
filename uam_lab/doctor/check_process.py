"""Runs a part of a check in a process of its own, for a bounded time."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

TOO_LATE = "no end within"


@dataclass(frozen=True)
class Said:
    """What a child said: `facts`, its lines of JSON put together; `problem`: why it did not end
    well, empty if it did."""

    facts: dict[str, Any]
    problem: str = ""


class CheckProcess:
    """`python -m module arguments...`. A context manager: nothing survives the `with` block."""

    def __init__(
        self,
        module: str,
        arguments: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
    ):
        """environment: variables on top of this process's own."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            env={**os.environ, **(environment or {})},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            process_group=0,  # Ctrl-C ends us, and we end it
        )

    def wait(self, seconds: float) -> Said:
        """What it said when it has ended, or was ended after `seconds`."""
        problem = ""
        try:
            text, _ = self._process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            self._end()
            text, _ = self._process.communicate()
            problem = f"{TOO_LATE} {seconds:g} s"
        facts, others = _sorted(text)
        status = self._process.returncode
        if not problem and status != 0:
            how = f"exit status {status}" if status > 0 else f"killed by signal {-status}"
            problem = others[-1] if others else how
        return Said(facts, problem)

    def _end(self) -> None:
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)

    def __enter__(self) -> CheckProcess:
        return self

    def __exit__(self, *exception) -> None:
        self._end()
        self._process.wait()
        self._process.stdout.close()


def _sorted(text: str) -> tuple[dict[str, Any], list[str]]:
    """The lines that are JSON objects, put together, and the others that are not empty."""
    facts, others = {}, []
    for line in text.splitlines():
        try:
            found = json.loads(line)
        except ValueError:
            found = None
        if isinstance(found, dict):
            facts |= found
        elif line.strip():
            others.append(line.strip())
    return facts, others


def say(**facts: Any) -> None:
    """In the child: tell `facts`."""
    print(json.dumps(facts), flush=True)
