"""What the layouts of the nodes must reach on a quiet machine with two cores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

PACE = "lockstep, simulated / wall time"
P50, P99 = "latency p50 [ms]", "latency p99 [ms]"
MISSED = "missed ticks [%]"
CORES = "cores of the nodes that fly"
BUSY = "completed beside a busy process per core [of all]"
# layout → quantity → (limit, whether the value may be above it)
TARGETS: dict[str, dict[str, tuple[float, bool]]] = {
    "separate": {PACE: (1.5, True), P50: (2.5, False), P99: (8.0, False), MISSED: (0.3, False)},
    "fused": {
        **{PACE: (3.0, True), P50: (1.5, False), P99: (4.0, False), MISSED: (0.05, False)},
        **{CORES: (0.35, False), BUSY: (1.0, True)},
    },
}


@dataclass(frozen=True)
class Value:
    """A measured value of a layout."""

    layout: str
    quantity: str
    value: float

    @property
    def target(self) -> tuple[float, bool] | None:
        """Return the limit and whether the value may be above it; None without a target."""
        return TARGETS.get(self.layout, {}).get(self.quantity)

    @property
    def reached(self) -> bool:
        """Return whether the value has reached its target; True without one."""
        if self.target is None:
            return True
        limit, above = self.target
        return self.value >= limit if above else self.value <= limit


def table(values: Sequence[Value]) -> str:
    """Return value against target, one line each."""
    lines = ["| layout | quantity | value | target | |", "|---|---|---|---|---|"]
    for one in values:
        target, verdict = "-", ""
        if one.target is not None:
            limit, above = one.target
            target = f"{'at least' if above else 'at most'} {limit:g}"
            verdict = "reached" if one.reached else "**missed**"
        lines.append(f"| {one.layout} | {one.quantity} | {one.value:.3g} | {target} | {verdict} |")
    return "\n".join(lines)
