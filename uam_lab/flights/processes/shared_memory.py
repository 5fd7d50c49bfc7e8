"""Room in /dev/shm: a process that finds none when it touches its memory there ends with SIGBUS."""

from pathlib import Path

import psutil

PLACE = Path("/dev/shm")
NEEDED = 8.0  # [MB] locks of multiprocessing, tracing of the middleware; a profile of its own: more


def shortage(place: Path = PLACE) -> str:
    """Return one line if there is too little room, else ""; "" too without such a place."""
    try:
        free = psutil.disk_usage(str(place)).free / 1e6
    except OSError:
        return ""
    if free >= NEEDED:
        return ""
    return (
        f"{place} has {free:.1f} MB left, {NEEDED:g} MB are needed: nodes would end with SIGBUS; "
        f"remove what is not used there (ls -la {place})"
    )
