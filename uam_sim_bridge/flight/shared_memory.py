"""Shared-memory files of the middleware (Fast DDS: /dev/shm/fastrtps_*, sem.fastrtps_*).

Those who end cleanly remove them, the last one those that several use. Who is killed cannot, and
what he used with others then stays as well. Ports are numbered over all ROS domains, and a file
that a process has opened but not yet mapped looks unused: so files are removed only while no other
flight is there (`Presence`).
"""

from __future__ import annotations

import fcntl
import os
import re
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

from uam_sim_bridge.flight import process_table

FOLDER = Path("/dev/shm")
# A participant's segment is named by a random number, a port by its own number.
NAME = re.compile(r"^(?:fastrtps_[0-9a-f]{16}|fastrtps_port\d+|sem\.fastrtps_port\d+_mutex)$")
ABANDONED = 3.0  # [s] a file that old and without a user was not just being created


def used_by(pid: int) -> set[Path]:
    """The middleware's files in the address space of a process; empty where /proc does not tell."""
    try:
        maps = Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return set()
    found = set()
    for line in maps.splitlines():
        words = line.split(maxsplit=5)
        path = Path(words[5]) if len(words) == 6 else None
        if path is not None and path.parent == FOLDER and NAME.match(path.name):
            found.add(path)
    return found


def abandoned(age: float = ABANDONED) -> set[Path]:
    """Files of this user that are older than `age` [s]; not all of them need be unused."""
    oldest = time.time() - age
    found = set()
    for path in FOLDER.glob("*fastrtps_*"):
        try:
            status = path.stat()
        except OSError:
            continue
        if NAME.match(path.name) and status.st_uid == os.getuid() and status.st_mtime < oldest:
            found.add(path)
    return found


def remove_unused(files: Iterable[Path]) -> list[Path]:
    """Remove those of `files` that no other process uses, each with its locks; returns them.

    Our own use does not count: the middleware lets go of a killed process's memory only after a
    while. A port's mutex is mapped only for a moment and outlives the port, even a clean end.
    """
    files = set(files)
    if not files:
        return []
    used = set().union(*(used_by(pid) for pid in process_table.pids() if pid != os.getpid()))
    removed = []
    for path in files:
        port = path.with_name(path.name.removeprefix("sem.").removesuffix("_mutex"))
        if path in used or port in used:
            continue
        locks = (path.with_name(path.name + "_el"), path.with_name(f"sem.{path.name}_mutex"))
        for file in (path, *locks):
            try:
                file.unlink()
                removed.append(file)
            except OSError:
                continue
    return removed


class Presence:
    """Held by every flight of this user while it lasts. A context manager.

    A lock that all share; the system drops it with the process that holds it.
    """

    def __init__(self, folder: Path | None = None):
        """Keep the lock's file in `folder`, by default the temporary one."""
        self._path = (folder or Path(tempfile.gettempdir())) / f"uam-{os.getuid()}-flights.lock"

    def __enter__(self) -> Presence:
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        self._lock = os.open(self._path, flags, 0o600)
        fcntl.flock(self._lock, fcntl.LOCK_SH)
        return self

    def __exit__(self, *exception) -> None:
        os.close(self._lock)

    def remove_unused(self, files: Iterable[Path]) -> list[Path]:
        """See `remove_unused` above; while other flights are there nothing is removed."""
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return remove_unused(files)
        except BlockingIOError:
            return []
        finally:
            fcntl.flock(self._lock, fcntl.LOCK_SH)
