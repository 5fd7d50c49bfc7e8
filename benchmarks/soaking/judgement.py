"""Detects growth: the maximum of a soak's last quarter against that of its first half.

The maximum is used, because Python's garbage collection makes the memory fluctuate.
"""

from __future__ import annotations

from dataclasses import dataclass

from soaking.samples import Soak

ALLOWED = 2.0  # [MB] and
SHARE = 0.03  # [1] of the memory, whichever is larger: allows for caches and late page faults


@dataclass(frozen=True)
class Verdict:
    """memory [MB], handles, threads: maximum of the first half, maximum of the last quarter."""

    name: str
    memory: tuple[float, float]
    handles: tuple[int, int]
    threads: tuple[int, int]

    @property
    def grown(self) -> bool:
        """Whether memory, handles or threads have grown."""
        before, after = self.memory
        more = after - before > max(ALLOWED, SHARE * before)
        return more or self.handles[1] > self.handles[0] or self.threads[1] > self.threads[0]


def judge(soak: Soak) -> list[Verdict]:
    """Return a verdict for each process with enough samples."""
    found = []
    for name, samples in soak.usage.items():
        if len(samples) < 8:
            continue
        columns = zip(*((one.memory, one.handles, one.threads) for _, one in samples), strict=True)
        half, quarter = len(samples) // 2, len(samples) // 4
        pairs = [(max(values[:half]), max(values[-quarter:])) for values in columns]
        found.append(Verdict(name, *pairs))
    return found


def table(verdicts: list[Verdict]) -> str:
    """Return the verdicts as a Markdown table."""
    lines = [
        "| process | memory [MB], most of the first half → last quarter | handles | threads | |",
        "|---|---|---|---|---|",
    ]
    for one in verdicts:
        handles, threads = one.handles, one.threads
        lines.append(
            f"| {one.name} | {one.memory[0]:.1f} → {one.memory[1]:.1f} "
            f"| {handles[0]} → {handles[1]} | {threads[0]} → {threads[1]} "
            f"| {'grown' if one.grown else 'flat'} |"
        )
    return "\n".join(lines)
