"""The nodes of flights among the processes of this machine, also those that lost their flight."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

import psutil

from uam_lab.processes.child import GRACE, TITLE

INIT = 1  # the parent of a process whose own parent has ended
POLL = 0.1  # [s]


def command(process: psutil.Process) -> list[str]:
    """The words of its command line; empty where it is gone or a kernel thread."""
    try:
        return " ".join(process.cmdline()).split()
    except psutil.Error:
        return []


def node_name(process: psutil.Process) -> str:
    """The name under which a flight started it, "" where it is no node of a flight."""
    title, *name = command(process) or [""]
    return " ".join(name) if title == TITLE else ""


def nodes(processes: Iterable[psutil.Process]) -> dict[psutil.Process, str]:
    """Those of `processes` that are nodes of flights, with their names."""
    found = {process: node_name(process) for process in processes}
    return {process: name for process, name in found.items() if name}


def orphans() -> list[psutil.Process]:
    """Nodes whose `uam fly` has gone; they end by themselves within child.GRACE, as a rule."""
    return [process for process in nodes(psutil.process_iter()) if _parent(process) == INIT]


def _parent(process: psutil.Process) -> int:
    try:
        return process.ppid()
    except psutil.Error:  # ended meanwhile
        return 0


def await_orphans(say: Callable[[str], None]) -> None:
    """Wait until the nodes of a flight that was killed have ended, at most a little over GRACE.

    Nobody holds their instance any more: one that starts could meet them in its ROS domain.
    """
    end = time.monotonic() + GRACE + 1.0
    left = orphans()
    if left:
        say(f"waiting for {len(left)} nodes of a flight that was killed to end")
    while left and time.monotonic() < end:
        time.sleep(POLL)
        left = orphans()
