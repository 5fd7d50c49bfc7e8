"""Processes as /proc tells of them, among them nodes that have lost their flight."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

from uam_lab.processes.child import GRACE, TITLE

PROC = Path("/proc")
INIT = 1
POLL = 0.1  # [s]


def pids() -> Iterator[int]:
    """Every process there is now."""
    for entry in PROC.glob("[0-9]*"):
        yield int(entry.name)


def command(pid: int) -> list[str]:
    """The command line of a process; empty where it is gone or a kernel thread."""
    try:
        text = (PROC / str(pid) / "cmdline").read_bytes().decode(errors="replace")
    except OSError:
        return []
    return [word for word in text.split("\0") if word]


def parent(pid: int) -> int:
    """The process that started it, INIT where that is gone; 0 where the process itself is."""
    try:
        return int((PROC / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()[1])
    except OSError:
        return 0


def node_name(pid: int) -> str:
    """What a flight has started it as, "" where it is no node of a flight."""
    title, _, name = "".join(command(pid)[:1]).partition(" ")
    return name if title == TITLE else ""


def orphans() -> list[int]:
    """Nodes whose `uam fly` has gone; they end by themselves within child.GRACE, as a rule."""
    return [pid for pid in pids() if node_name(pid) and parent(pid) == INIT]


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
