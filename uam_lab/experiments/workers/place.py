"""Where the work is done; imported by every command, so without Dask."""

import os
from dataclasses import dataclass


class WorkersError(RuntimeError):
    """The workers cannot be used, or were lost; the text is one line."""


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Workplace:
    """Where the work is done."""

    jobs: int
    scheduler: str = ""  # address of a Dask scheduler, "" for `jobs` processes of this machine
