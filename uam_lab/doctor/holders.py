"""Which processes hold a port or a lock, as /proc tells: own processes, or all of them for root."""

from __future__ import annotations

import os
from pathlib import Path

from uam_lab.processes.process_table import PROC, command, node_name, pids


def of_port(protocol: str, port: int) -> list[str]:
    """Processes with a socket at local `port`; protocol: tcp or udp. Empty if that is not told."""
    inodes = set()
    for table in (protocol, protocol + "6"):
        try:
            lines = (PROC / "net" / table).read_text().splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            words = line.split()
            if int(words[1].rsplit(":", 1)[1], 16) == port:
                inodes.add(f"socket:[{words[9]}]")
    return _with_open(inodes)


def of_file(path: Path) -> list[str]:
    """Processes that have the file open."""
    return _with_open({str(path)})


def _with_open(targets: set[str]) -> list[str]:
    """Names and ids of processes with an open file that is one of `targets`."""
    return [name_of(pid) for pid in pids() if not targets.isdisjoint(_open_files(pid))]


def name_of(pid: int) -> str:
    """As "mujoco_sim (process 4711)"."""
    words = command(pid)
    known = [
        word.rsplit(".", 1)[-1]
        for word in words[1:]
        if word.startswith(("uam_sim_bridge.", "uam_control.", "uam_lab."))
    ]
    program = Path(words[0]).name if words else "a program"
    name = node_name(pid) or (known[-1] if known else program)
    return f"{name} (process {pid})"


def _open_files(pid: int) -> set[str]:
    found = set()
    try:
        for link in (PROC / str(pid) / "fd").iterdir():
            try:
                found.add(os.readlink(link))
            except OSError:
                continue
    except OSError:  # another user's, or gone
        pass
    return found
