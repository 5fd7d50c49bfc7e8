"""Asynchronous service calls: a callback gets the response, or the reason of a failure."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from uam_msgs_py.messages.topics import Topic

PATIENCE = 3.0  # [s] of wall time for an answer

Answer = Callable[[Any, str], None]


class Services:
    """Service clients of one node. `look` calls the callbacks, in the thread of its caller."""

    def __init__(self, node: Node):
        self._node = node
        self._clients: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._open: list[tuple[Any, Any, float, Answer]] = []

    def client(self, kind: type, name: str) -> Any:
        """Return the client of the service `name`; create it if necessary."""
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name)
        return self._clients[name]

    def publish(self, topic: Topic, message: Any) -> None:
        """Publish a message; the publisher is made at the first one that is asked for."""
        self.offer(topic).publish(message)

    def offer(self, topic: Topic) -> Any:
        """Return the publisher of a topic; create it if necessary."""
        if topic.name not in self._publishers:
            made = self._node.create_publisher(topic.type, topic.name, topic.qos)
            self._publishers[topic.name] = made
        return self._publishers[topic.name]

    def ready(self, kind: type, name: str) -> bool:
        """Return whether a node offers the service."""
        return self.client(kind, name).service_is_ready()

    def call(self, kind: type, name: str, request: Any, answer: Answer) -> None:
        """Call a service; `look` later calls answer(response, "") or answer(None, reason)."""
        client = self.client(kind, name)
        if not client.service_is_ready():
            answer(None, f"{name}: service not found")
            return
        end = time.monotonic() + PATIENCE
        self._open.append((client, client.call_async(request), end, answer))

    def look(self) -> None:
        """Call the callbacks of received responses and of expired requests."""
        now = time.monotonic()
        still, self._open = self._open, []
        for client, future, end, answer in still:
            if future.done():
                answer(future.result(), "")
            elif now > end:
                client.remove_pending_request(future)
                answer(None, f"{client.srv_name}: no response")
            else:
                self._open.append((client, future, end, answer))
