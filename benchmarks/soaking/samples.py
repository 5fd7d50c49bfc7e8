"""What a process uses, over the time of a soak."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import psutil


@dataclass(frozen=True)
class Usage:
    """memory [MB]: its own, neither shared nor of files."""

    memory: float
    handles: int
    threads: int


def usage(pid: int) -> Usage | None:
    """What a process uses now; None where it is gone."""
    try:
        process = psutil.Process(pid)
        memory = process.memory_info()
        return Usage((memory.rss - memory.shared) / 1e6, process.num_fds(), process.num_threads())
    except psutil.Error:
        return None


@dataclass
class Soak:
    """What was seen. usage: by process, each (time of the soak [s], what it used).

    unit: of the time, as the picture names it; failed: whether the flight itself went wrong;
    interrupted: by people, and what is here is what had been seen by then.
    """

    title: str
    unit: str
    usage: dict[str, list[tuple[float, Usage]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    failed: bool = False
    interrupted: bool = False

    def add(self, name: str, time: float, used: Usage) -> None:
        """Note what a process used at a time [s]."""
        self.usage.setdefault(name, []).append((time, used))

    def to_mapping(self, verdicts: Sequence[object]) -> dict[str, object]:
        """As JSON takes it."""
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
