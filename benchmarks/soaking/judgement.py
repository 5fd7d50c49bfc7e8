"""Whether something has grown: the second half of a soak against the quarter before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soaking.samples import Soak

ALLOWED = 2.0  # [MB] and
SHARE = 0.03  # [1] of the memory, whichever is more: caches that fill, pages that are touched late


@dataclass(frozen=True)
class Verdict:
    """memory [MB]: medians of the second and of the last quarter; handles, threads: likewise."""

    name: str
    memory: tuple[float, float]
    handles: tuple[float, float]
    threads: tuple[float, float]

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
        columns = np.array([(one.memory, one.handles, one.threads) for _, one in samples])
        quarter = len(columns) // 4
        before = np.median(columns[quarter : 2 * quarter], axis=0)
        after = np.median(columns[-quarter:], axis=0)
        pairs = [(float(b), float(a)) for b, a in zip(before, after, strict=True)]
        found.append(Verdict(name, *pairs))
    return found


def table(verdicts: list[Verdict]) -> str:
    """As Markdown."""
    lines = [
        "| process | memory [MB], second → last quarter | file handles | threads | |",
        "|---|---|---|---|---|",
    ]
    for one in verdicts:
        handles, threads = one.handles, one.threads
        lines.append(
            f"| {one.name} | {one.memory[0]:.1f} → {one.memory[1]:.1f} "
            f"| {handles[0]:.0f} → {handles[1]:.0f} | {threads[0]:.0f} → {threads[1]:.0f} "
            f"| {'grown' if one.grown else 'flat'} |"
        )
    return "\n".join(lines)
