"""Publishes the restart of a node on /uam/restarts and /diagnostics."""

from __future__ import annotations

from rclpy.node import Node

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import WARN, diagnostic


class RestartTopic:
    """Publishers of the restarts, for the plant, the log and the displays."""

    def __init__(self, node: Node) -> None:
        self._publishers = [
            node.create_publisher(topic.type, topic.name, topic.qos)
            for topic in (topics.RESTARTS, topics.DIAGNOSTICS)
        ]

    def tell(self, stamp: int, node: str, text: str) -> None:
        """Publish the restart of `node`; stamp [ns]: of the flight's clock."""
        message = diagnostic(stamp, node, WARN, text, {})
        for publisher in self._publishers:
            publisher.publish(message)
