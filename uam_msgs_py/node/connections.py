"""Established connections between nodes, from both ends' counts in /diagnostics.

The ROS graph lists publishers and subscriptions, but not whether the two ends are connected yet;
before that messages are lost. Only the ends themselves count their connections. A reproducible
flight must wait for all connections before its first tick.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import finite
from uam_msgs_py.node.namespace import expanded, prefix

NAMELESS = "_NODE_NAME_UNKNOWN_"  # of the middleware, before it has a node's name
READERS, WRITERS = "readers of ", "writers of "


def of(
    node: Node,
    outlets: Mapping[str, Publisher],
    inlets: Mapping[str, Subscription],
) -> dict[str, int]:
    """Return the diagnostic values: for each topic of `node`, its number of connected ends."""
    counts = {
        READERS: {name: outlet.get_subscription_count() for name, outlet in outlets.items()},
        WRITERS: {name: _writers(node, inlet) for name, inlet in inlets.items()},
    }
    return {
        kind + expanded(node.get_namespace(), name): count
        for kind, found in counts.items()
        for name, count in found.items()
    }


def _writers(node: Node, inlet: Subscription) -> int:
    """Return the number of connected publishers whose node name is known in the node's graph.

    The name may arrive after the connection; until then `SolePublisher` refuses the messages.
    """
    ends = node.get_publishers_info_by_topic(inlet.topic_name)
    named = sum(end.node_name != NAMELESS for end in ends)
    return min(inlet.get_publisher_count(), named)


class Connections:
    """Collects the diagnostic values of the nodes in the namespace of `node`.

    A node without diagnostics has no connections.

    Diagnostics are sent once a second, so the counts may be a second old.
    """

    def __init__(self, node: Node, spun: bool = True):
        """spun: `node` is spun; else its owner passes the messages by `note`."""
        self._values: dict[str, dict[str, str]] = {}
        self._reports: Counter[str] = Counter()
        self._namespace = node.get_namespace()
        if spun:
            topic = topics.DIAGNOSTICS
            node.create_subscription(topic.type, topic.name, self.note, topic.qos)

    def note(self, message: DiagnosticArray) -> None:
        """Take a message of /diagnostics."""
        for status in message.status:
            self._values[status.name] = {pair.key: pair.value for pair in status.values}
            self._reports[status.name] += 1

    def reports(self, node: str) -> int:
        """Return the number of reports of a node so far."""
        return self._reports[prefix(self._namespace) + node]

    def count(self, node: str, kind: str, topic: str) -> int:
        """Return the number of READERS or WRITERS (kind) of `topic` that `node` is connected to."""
        values = self._values.get(prefix(self._namespace) + node, {})
        return int(finite(values.get(kind + expanded(self._namespace, topic))) or 0)
