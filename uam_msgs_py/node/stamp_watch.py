"""Finds topics whose stamps come from another clock than the ticks.

Such a message would never find its tick, or make a dead sensor look fresh. The clock of a node's
ticks is the input that starts them: the IMU's stamps in the estimator, those of the state in the
other nodes.
"""

from __future__ import annotations

from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import BadMessage

CLOCKS = (topics.IMU.name, topics.STATE.name)
FAR = SECOND  # [ns] difference to the clock from which a stamp is foreign
LASTING = 10  # ticks for which it lasts: a new simulation, or a stalled node, differs for few


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
