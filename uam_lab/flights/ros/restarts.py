"""Restart of a node: its parameters as changed in flight, and the message about the restart."""

from __future__ import annotations

import json
from typing import Any

from rclpy.node import Node

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.parameter_changes import ParameterChange
from uam_msgs_py.messages.status import WARN, diagnostic
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.namespace import prefix
from uam_msgs_py.node.polling import listen


class ChangedParameters:
    """Subscription to /uam/parameter_changes; polled, so it needs no executor."""

    def __init__(self, node: Node, door: Door) -> None:
        """door: of the node."""
        self._subscription, self._door = listen(node, topics.CHANGES), door
        self._namespace = node.get_namespace()
        self._newest: dict[str, dict[str, Any]] = {}  # node → parameter → value

    def poll(self) -> None:
        """Store the received changes; only those that the node itself has sent."""
        own = prefix(self._namespace)
        for _, change in self._door.decoded(self._subscription, ParameterChange.from_message):
            # another sender could end the restart by an argument that the node refuses
            if self._door.sender(self._subscription) == f"/{own}{change.node}":
                self.note(change)

    def note(self, change: ParameterChange) -> None:
        """Store a change if it was accepted."""
        if change.accepted:
            values = {name: new for name, (_, new) in change.values.items()}
            self._newest.setdefault(change.node, {}).update(values)

    def arguments(self, node: str) -> list[str]:
        """Return the ROS arguments with a node's newest values, to append to its arguments.

        Each value is given twice: that of a named node goes before the node's section of a
        parameter file, but ROS applies it only without a namespace.
        """
        values = self._newest.get(node, {}).items()
        pairs = [
            f"{to}{name}:={json.dumps(new)}" for name, new in values for to in ("", f"{node}:")
        ]
        return [text for pair in pairs for text in ("-p", pair)]


class RestartTopic:
    """Publishes a restart on /uam/restarts and /diagnostics, for plant, log and displays."""

    def __init__(self, node: Node) -> None:
        self._prefix = prefix(node.get_namespace())
        self._restarts, self._diagnostics = (
            node.create_publisher(topic.type, topic.name, topic.qos)
            for topic in (topics.RESTARTS, topics.DIAGNOSTICS)
        )

    def publish(self, stamp: int, node: str, text: str) -> None:
        """Publish the restart of `node`; stamp [ns]: of the flight's clock."""
        self._restarts.publish(diagnostic(stamp, node, WARN, text, {}))
        self._diagnostics.publish(diagnostic(stamp, self._prefix + node, WARN, text, {}))
