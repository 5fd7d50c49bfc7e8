"""Runs a part of a check in a separate process, with a time limit."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

TOO_LATE = "no end within"


@dataclass(frozen=True)
class Said:
    """Output of a child."""

    facts: dict[str, Any]  # its lines of JSON, merged
    problem: str = ""  # reason of a failure, empty without one


class CheckProcess:
    """`python -m module arguments...`. Context manager: the process ends with the `with` block."""

    def __init__(
        self,
        module: str,
        arguments: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
    ):
        """environment: variables in addition to those of this process."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            env={**os.environ, **(environment or {})},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            process_group=0,  # Ctrl-C reaches only the parent, which ends the child
            encoding="utf-8",
        )

    def wait(self, seconds: float) -> Said:
        """Wait for the end, kill the process after `seconds`; return its output."""
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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception) -> None:
        self._end()
        self._process.wait()
        self._process.stdout.close()


def _sorted(text: str) -> tuple[dict[str, Any], list[str]]:
    """Return the JSON objects among the lines, merged, and the other non-empty lines."""
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
    """In the child: print `facts` as a line of JSON."""
    print(json.dumps(facts), flush=True)
