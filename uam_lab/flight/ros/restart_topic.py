"""/uam/restarts and /diagnostics: a node was lost and is started again."""

from __future__ import annotations

from rclpy.node import Node

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import WARN, diagnostic


class RestartTopic:
    """Publishes each restart, for the plant, the log and those who watch."""

    def __init__(self, node: Node) -> None:
        self._publishers = [
            node.create_publisher(topic.type, topic.name, topic.qos)
            for topic in (topics.RESTARTS, topics.DIAGNOSTICS)
        ]

    def tell(self, stamp: int, node: str, text: str) -> None:
        """Say what became of a node; stamp [ns]: of the flight's clock."""
        message = diagnostic(stamp, node, WARN, text, {})
        for publisher in self._publishers:
            publisher.publish(message)
