"""Table of the flights under load."""

from __future__ import annotations

from collections.abc import Sequence

from loading.flight import Measured

HEAD = (
    "condition",
    "outcome",
    "latency p50, p99 [ms]",
    "missed ticks",
    "pace",
    "RMS position [m]",
    "messages lost",
    "causes",
)


def markdown(found: Sequence[Measured]) -> str:
    """Return one line per flight; in brackets: relative to the first."""
    first = found[0]
    lines = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
    for one in found:
        cells = (
            one.condition,
            one.outcome,
            f"{one.latency_p50:.1f}, {one.latency_p99:.1f} "
            f"({_times(one.latency_p50, first.latency_p50)}, "
            f"{_times(one.latency_p99, first.latency_p99)})",
            f"{one.missed} of {one.ticks}",
            f"{one.pace:.3f}",
            f"{one.position:.3f} ({_times(one.position, first.position)})",
            str(one.lost_messages),
            one.causes,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _times(value: float, of: float) -> str:
    return f"x {value / of:.1f}" if of > 0.0 else "–"
