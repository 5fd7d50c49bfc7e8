"""Search for nodes of flights among the processes of this machine, orphans included."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

import psutil

from uam_lab.processes.child import GRACE, TITLE

INIT = 1  # the parent of a process whose own parent has ended
POLL = 0.1  # [s]


def command(process: psutil.Process) -> list[str]:
    """Return the words of a command line; empty for an ended process or a kernel thread."""
    try:
        return " ".join(process.cmdline()).split()
    except psutil.Error:
        return []


def node_name(process: psutil.Process) -> str:
    """Return the name of a flight's node, "" for other processes."""
    title, *name = command(process) or [""]
    return " ".join(name) if title == TITLE else ""


def nodes(processes: Iterable[psutil.Process]) -> dict[psutil.Process, str]:
    """Return the nodes of flights among `processes`, with their names."""
    found = {process: node_name(process) for process in processes}
    return {process: name for process, name in found.items() if name}


def orphans() -> list[psutil.Process]:
    """Return the nodes whose `uam fly` has ended; normally they end within child.GRACE."""
    return [process for process in nodes(psutil.process_iter()) if _parent(process) == INIT]


def _parent(process: psutil.Process) -> int:
    try:
        return process.ppid()
    except psutil.Error:  # ended meanwhile
        return 0


def await_orphans(say: Callable[[str], None]) -> None:
    """Wait until the nodes of a killed flight have ended, at most GRACE + 1 s.

    Their instance is free again, so a new flight could have the same ROS domain.
    """
    end = time.monotonic() + GRACE + 1.0
    left = orphans()
    if left:
        say(f"waiting for the end of {len(left)} nodes of a killed flight")
    while left and time.monotonic() < end:
        time.sleep(POLL)
        left = orphans()
