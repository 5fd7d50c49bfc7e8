"""Shared-memory files of the middleware (Fast DDS: /dev/shm/fastrtps_*, sem.fastrtps_*).

A participant that ends cleanly removes its own; one that is killed cannot.
"""

import re
from collections.abc import Iterable
from pathlib import Path

FOLDER = Path("/dev/shm")
# A participant's segment is named by a random number; a port by the UDP port it stands for.
SEGMENT = re.compile(r"^fastrtps_[0-9a-f]{16}$")
PORT = re.compile(r"^(?:sem\.)?fastrtps_port(\d+)(?:_mutex)?$")
# Ports below belong to multicast groups that every domain on the machine shares.
FIRST_PRIVATE_PORT = 7400


def used_by(pid: int) -> set[Path]:
    """The middleware's files in the address space of a process; empty where /proc does not tell."""
    try:
        maps = Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return set()
    found = set()
    for line in maps.splitlines():
        path = Path(line.split(maxsplit=5)[5]) if line.count(" ") >= 5 and "/" in line else None
        if path is not None and path.parent == FOLDER and _is_private(path.name):
            found.add(path)
    return found


def _is_private(name: str) -> bool:
    port = PORT.match(name)
    return bool(SEGMENT.match(name)) or (port is not None and int(port[1]) >= FIRST_PRIVATE_PORT)


def remove(files: Iterable[Path]) -> list[Path]:
    """Remove these files and their lock files (`_el`); returns those that were still there.

    Only for files whose users have all ended.
    """
    removed = []
    for file in files:
        for path in (file, file.with_name(file.name + "_el")):
            try:
                path.unlink()
                removed.append(path)
            except OSError:
                continue
    return removed
