"""Processes that hold a port or a lock: those of the user, or all of them for root."""

from __future__ import annotations

from pathlib import Path

import psutil

from uam_lab.processes.process_table import command, node_name


def of_port(protocol: str, port: int) -> list[str]:
    """Return the processes with a socket at local `port`; protocol: tcp or udp. May be empty."""
    sockets = psutil.net_connections(kind=protocol)
    found = {one.pid for one in sockets if one.pid and one.laddr and one.laddr.port == port}
    return [name_of(pid) for pid in sorted(found)]


def of_file(path: Path) -> list[str]:
    """Return the processes that have the file open."""
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
