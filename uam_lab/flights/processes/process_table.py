"""Search among the processes of this machine: nodes of flights, orphans, users of ports and files.

Of other users the processes are seen by root only.
"""

import time
from collections.abc import Callable, Iterable
from pathlib import Path

import psutil

from uam_lab.flights.processes.child import GRACE, TITLE

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


def users_of_port(protocol: str, port: int) -> list[str]:
    """Return the processes with a socket at local `port`; protocol: tcp or udp. May be empty."""
    sockets = psutil.net_connections(kind=protocol)
    found = {one.pid for one in sockets if one.pid and one.laddr and one.laddr.port == port}
    return [name_of(pid) for pid in sorted(found)]


def users_of_file(path: Path) -> list[str]:
    return [name_of(one.pid) for one in psutil.process_iter() if str(path) in _open_files(one)]


def _open_files(process: psutil.Process) -> set[str]:
    try:
        return {file.path for file in process.open_files()}
    except psutil.Error:  # of another user, or ended
        return set()


def name_of(pid: int) -> str:
    """Return name and pid, as "mujoco_sim (process 4711)"."""
    try:
        process = psutil.Process(pid)
    except psutil.NoSuchProcess:
        return f"a program (process {pid})"
    words = command(process)
    known = [
        word.rsplit(".", 1)[-1]
        for word in words[1:]
        if word.startswith(("uam_sim_bridge.", "uam_control.", "uam_lab."))
    ]
    program = Path(words[0]).name if words else "a program"
    name = node_name(process) or (known[-1] if known else program)
    return f"{name} (process {pid})"
