"""Diagnostic values of a node: processing time of its ticks, age and clock of its inputs.

A message whose stamp comes from another clock than the ticks would never find its tick, or make a
dead sensor look fresh. The clock of a node's ticks is the input that starts them: the IMU's stamps
in the estimator, those of the state in the other nodes.
"""

import time
from collections.abc import Iterable, Mapping

from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.node.namespace import expanded

CLOCKS = (topics.IMU.name, topics.STATE.name)
FAR = SECOND  # [ns] difference to the clock from which a stamp is foreign
LASTING = 10  # ticks for which it lasts: a new simulation, or a stalled node, differs for few


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
    """
    now = time.monotonic()
    return {
        f"age of {expanded(namespace, name)} [ms]": (
            f"{1e3 * (now - arrivals[name]):.1f}" if name in arrivals else ""
        )
        for name in inputs
    }


class StampWatch:
    """Compares the stamps of a node's inputs with those of its clock.

    An input counts as foreign when it differs by more than FAR for more than LASTING messages of
    the clock. While the clock is silent, nothing becomes foreign.
    """

    def __init__(self) -> None:
        self.clock = ""  # topic
        self._newest: int | None = None  # [ns] stamp of the clock
        self._far: dict[str, tuple[int, int]] = {}  # topic → ticks so far, newest of the clock

    def listen(self, topic: str) -> None:
        """Take the node's input `topic` as its clock, if it is one."""
        if topic in CLOCKS and self.clock != CLOCKS[0]:
            self.clock = topic

    def check(self, topic: str, stamp: int, clock_node: str) -> None:
        """Check a message's stamp [ns]; clock_node: publisher of the clock, for the text.

        Raises BadMessage for one of another clock.
        """
        if topic == self.clock:
            self._newest = stamp
            return
        newest = self._newest
        if newest is None or abs(stamp - newest) <= FAR:
            self._far.pop(topic, None)
            return
        ticks, seen = self._far.get(topic, (0, None))
        ticks += seen != newest
        self._far[topic] = ticks, newest
        if ticks > LASTING:
            raise BadMessage(
                f"stamp {stamp / SECOND:.3f} s is of another clock than {newest / SECOND:.3f} s "
                f"of {self.clock} by {clock_node}"
            )
