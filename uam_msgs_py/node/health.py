"""Diagnostic values of a node: processing time of its ticks, age of its inputs."""

import time
from collections.abc import Iterable, Mapping

from uam_msgs_py.node.namespace import expanded


class LoopTime:
    """Mean and largest processing time since the last report."""

    def __init__(self) -> None:
        self._sum = self._max = 0.0  # [s]
        self._count = 0

    def add(self, begun: float) -> None:
        """Add the time since `begun`, a value of time.perf_counter() [s]."""
        spent = time.perf_counter() - begun
        self._sum += spent
        self._max = max(self._max, spent)
        self._count += 1

    def report(self, what: str = "tick") -> dict[str, str]:
        """Return the diagnostic values since the last report, "" without any; reset them."""
        count, total, most = self._count, self._sum, self._max
        self._sum = self._max = 0.0
        self._count = 0
        return {
            f"{what} mean [ms]": f"{1e3 * total / count:.3f}" if count else "",
            f"{what} max [ms]": f"{1e3 * most:.3f}" if count else "",
        }


def ages(inputs: Iterable[str], arrivals: Mapping[str, float], namespace: str) -> dict[str, str]:
    """Return the diagnostic values: age (wall time) of each input's newest valid message.

    arrivals: topic → time.monotonic() [s]; the age is "" for an input without a message.
    namespace: of the node.
    """
    now = time.monotonic()
    return {
        f"age of {expanded(namespace, name)} [ms]": (
            f"{1e3 * (now - arrivals[name]):.1f}" if name in arrivals else ""
        )
        for name in inputs
    }
