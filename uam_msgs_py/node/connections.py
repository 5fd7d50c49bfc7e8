"""Which connections really exist, as the nodes at both ends say in /diagnostics.

The ROS graph tells who wants to publish and listen; it does not tell whether the two ends have
found each other yet, and until they have, messages are lost. Only the ends themselves know. A
flight that is to be the same from its first tick on has to wait for them.
"""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from uam_msgs_py.messages import topics

READERS, WRITERS = "readers of ", "writers of "
RECORDER, RECORDED_UNTIL = "recorder", "recorded until [s]"


def of(outlets: Mapping[str, Publisher], inlets: Mapping[str, Subscription]) -> dict[str, int]:
    """Return the diagnostic values: for each topic of a node, how many other ends it has found."""
    found = {READERS + name: outlet.get_subscription_count() for name, outlet in outlets.items()}
    return found | {WRITERS + name: inlet.get_publisher_count() for name, inlet in inlets.items()}


class Connections:
    """Listens to what the nodes say; a node that has said nothing yet has no connections.

    Diagnostics come once a second, so this lags behind by up to as much.
    """

    def __init__(self, node: Node):
        self._said: dict[str, dict[str, str]] = {}
        topic = topics.DIAGNOSTICS
        node.create_subscription(topic.type, topic.name, self._note, topic.qos)

    def _note(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._said[status.name] = {pair.key: pair.value for pair in status.values}

    def readers(self, node: str, topic: str) -> int:
        """How many listeners the publisher of `topic` in `node` has found."""
        return self._count(node, READERS + topic)

    def writers(self, node: str, topic: str) -> int:
        """How many publishers the subscription to `topic` in `node` has found."""
        return self._count(node, WRITERS + topic)

    def recorded_until(self) -> float:
        """Simulation time [s] up to which the recorder had everything when it spoke last."""
        return float(self._said.get(RECORDER, {}).get(RECORDED_UNTIL, 0.0))

    def _count(self, node: str, key: str) -> int:
        return int(self._said.get(node, {}).get(key, 0))
