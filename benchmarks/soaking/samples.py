"""Samples of the memory, handles and threads of processes over a soak."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import psutil


@dataclass(frozen=True)
class Usage:
    """memory [MB]: resident memory without shared pages."""

    memory: float
    handles: int
    threads: int


def usage(pid: int) -> Usage | None:
    """Return the current usage of a process, None if it has ended."""
    try:
        process = psutil.Process(pid)
        memory = process.memory_info()
        return Usage((memory.rss - memory.shared) / 1e6, process.num_fds(), process.num_threads())
    except psutil.Error:
        return None


@dataclass
class Soak:
    """Samples of a soak. usage: by process, each (time of the soak [s], usage).

    unit: label of the time axis; failed: whether the flight failed; interrupted: by the user, with
    the samples up to then.
    """

    title: str
    unit: str
    usage: dict[str, list[tuple[float, Usage]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    failed: bool = False
    interrupted: bool = False

    def add(self, name: str, time: float, used: Usage) -> None:
        """Add the usage of a process at a time [s]."""
        self.usage.setdefault(name, []).append((time, used))

    def to_mapping(self, verdicts: Sequence[object]) -> dict[str, object]:
        """Return a mapping for JSON."""
        seen = {
            name: [(time, used.memory, used.handles, used.threads) for time, used in samples]
            for name, samples in self.usage.items()
        }
        return {
            "title": self.title,
            "notes": self.notes,
            "failed": self.failed,
            "verdicts": [asdict(one) for one in verdicts],
            "usage": {"columns": ["time_s", "memory_mb", "handles", "threads"], "processes": seen},
        }
