"""Whether something has grown: the most of a soak's last quarter against that of its first half.

The most, because memory that Python collects now and then comes and goes.
"""

from __future__ import annotations

from dataclasses import dataclass

from soaking.samples import Soak

ALLOWED = 2.0  # [MB] and
SHARE = 0.03  # [1] of the memory, whichever is more: caches that fill, pages that are touched late


@dataclass(frozen=True)
class Verdict:
    """memory [MB]: the most of the first half, and of the last quarter; the others likewise."""

    name: str
    memory: tuple[float, float]
    handles: tuple[int, int]
    threads: tuple[int, int]

    @property
    def grown(self) -> bool:
        """Whether it would not go on for ever."""
        before, after = self.memory
        more = after - before > max(ALLOWED, SHARE * before)
        return more or self.handles[1] > self.handles[0] or self.threads[1] > self.threads[0]


def judge(soak: Soak) -> list[Verdict]:
    """A verdict of each process that was seen long enough."""
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
    """As Markdown."""
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
