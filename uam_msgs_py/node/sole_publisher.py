"""One publisher per topic of the control loop: messages of any other are refused.

Two publishers of one command would alternate and tumble the vehicle. Who is the rightful one:

- the node that `wiring.WIRES` names, in the same namespace, wherever it publishes the topic;
- without it the first that sends. A sensor's publisher stays, once the node works with it: a
  simulator that somebody starts must not replace the sensors of a vehicle in the air;
- with NAMED on the command line (`uam fly`) nobody else than the named node, from the start.

Another one takes over when the rightful one has left the graph, or when it has the same node name
and the rightful one is silent: a node that was started again after a crash.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from uam_msgs_py.node import wiring
from uam_msgs_py.node.taking import Taker

NAMED = "--named-publishers"
PUBLISHERS = {wire.topic.name: wire.publisher for wire in wiring.WIRES}
LOOK_PERIOD = 0.02  # [s] wall time between two looks at the graph
SILENT = 250_000_000  # [ns] wall time after which a publisher of the same name takes over
UNKNOWN = "unknown node"


class SolePublisher:
    """Takes the messages of one publisher of a subscription, in place of rclpy's handle."""

    def __init__(
        self, node: Node, subscription: Subscription, name: str, works: Callable[[], bool]
    ):
        """name: of the topic in WIRES; works: whether the node has worked with the messages."""
        self._node, self._topic, self._works = node, subscription.topic_name, works
        self._expected = _full(node.get_namespace(), PUBLISHERS[name])
        self._is_sensor = PUBLISHERS[name] == wiring.PLANT
        self._only_named = NAMED in sys.argv
        self.taker = Taker(subscription)
        self._gid = b""  # of the rightful publisher
        self._last = 0  # [ns] wall time of its last message
        self._looked = 0.0  # time.monotonic() of the last look at the graph
        self._foreign: dict[bytes, str] = {}  # gid → node name
        self._counts: dict[bytes, int] = {}  # gid → refused messages
        self.rightful = ""  # node name

    def take(self) -> bytes | None:
        """Return the next message of the rightful publisher, serialized; None without one."""
        taker = self.taker
        while (data := taker.take()) is not None:
            if taker.gid == self._gid or self._takes_over():
                self._last = taker.info.received_timestamp
                return data
        return None

    def take_message(self, kind: type, raw: bool) -> tuple[Any, dict[str, int]] | None:
        """Return the next message and its times, as rclpy's handle does."""
        data = self.take()
        if data is None:
            return None
        message = data if raw else deserialize_message(data, kind)
        return message, {"source_timestamp": self.taker.info.source_timestamp}

    @property
    def refused(self) -> dict[str, int]:
        """Foreign node → number of its refused messages."""
        found: dict[str, int] = {}
        for gid, count in self._counts.items():
            name = self._foreign.get(gid, UNKNOWN)
            found[name] = found.get(name, 0) + count
        return found

    def complaint(self) -> str:
        """Return one line about foreign publishers, "" without any."""
        refused = self.refused
        if not refused:
            return ""
        names = ", ".join(f"{name} ({count} messages)" for name, count in refused.items())
        return f"{self._topic}: refused {names}; publisher is {self.rightful or self._expected}"

    def _takes_over(self) -> bool:
        """Return whether the publisher of the last message becomes the rightful one."""
        gid, now = bytes(self.taker.gid), time.monotonic()
        if gid not in self._counts or now - self._looked >= LOOK_PERIOD:
            self._looked = now
            names = self._publishers()
            if self._may(gid, names):
                self._gid, self.rightful = gid, names.get(gid, UNKNOWN)
                self._counts.pop(gid, None)
                return True
            if gid in names:
                self._foreign[gid] = names[gid]
        self._counts[gid] = self._counts.get(gid, 0) + 1
        return False

    def _may(self, gid: bytes, names: dict[bytes, str]) -> bool:
        name, expected = names.get(gid, UNKNOWN), self._expected
        named = name == expected
        if self._gid in names:  # the rightful one is there
            if name == self.rightful:
                return self.taker.info.received_timestamp - self._last > SILENT
            return named and not (self._is_sensor and self._works())
        return named or not (self._only_named or expected in names.values())

    def _publishers(self) -> dict[bytes, str]:
        """Return the publishers in the graph: gid → full node name."""
        return {
            bytes(end.endpoint_gid): _full(end.node_namespace, end.node_name)
            for end in self._node.get_publishers_info_by_topic(self._topic)
        }


def complaints(guards: Iterable[SolePublisher]) -> list[str]:
    """Return one line per topic with foreign publishers."""
    return [text for guard in guards if (text := guard.complaint())]


def _full(namespace: str, name: str) -> str:
    return f"{namespace.rstrip('/')}/{name}"
