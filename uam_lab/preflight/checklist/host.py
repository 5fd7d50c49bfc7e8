"""Readings of the companion computer."""

import ctypes
import os
import resource
import shutil
import time
from pathlib import Path

from uam_lab.preflight.checklist.observation import Host

GOVERNORS = Path("/sys/devices/system/cpu")
TIMEX_BYTES = 256  # more than the kernel's struct timex
UNSYNCHRONISED = 5  # TIME_ERROR, adjtimex(2)
ROOT_PRIORITY = 99.0


class HostReader:
    """Reads the computer; jumps of the clock are counted from the first reading on."""

    def __init__(self, folder: Path) -> None:
        """folder: of the recording."""
        self._folder = folder
        self._offset = _clock_offset()

    def read(self) -> Host:
        """Return the present readings."""
        return Host(
            free_space(self._folder),
            clock_synchronised(),
            _clock_offset() - self._offset,
            governors(),
            realtime_priority(),
        )


def free_space(folder: Path) -> float | None:
    """Return the free space [bytes] at `folder`, or where it will be created; None: unknown."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    try:
        return float(shutil.disk_usage(folder).free)
    except OSError:
        return None


def clock_synchronised() -> bool | None:
    """Return whether the kernel's clock is synchronised, by adjtimex(2); None: unknown."""
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))
    except (OSError, AttributeError):
        return None
    return None if state < 0 else state != UNSYNCHRONISED


def governors(folder: Path = GOVERNORS) -> tuple[str, ...]:
    """Return the frequency governor of each core, () without frequency scaling."""
    found = []
    for file in sorted(folder.glob("cpu[0-9]*/cpufreq/scaling_governor")):
        try:
            found.append(file.read_text(encoding="utf-8").strip())
        except OSError:  # a core that is switched off
            continue
    return tuple(found)


def realtime_priority() -> float:
    """Return the highest real-time priority that this account may use."""
    if os.geteuid() == 0:
        return ROOT_PRIORITY
    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    return ROOT_PRIORITY if soft == resource.RLIM_INFINITY else float(soft)


def _clock_offset() -> float:
    """Return the system's clock minus the monotonic one [s]: it changes when the clock is set."""
    return time.time() - time.monotonic()
