"""Calls of services that do not wait: the answer comes when it comes, or why none did."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

PATIENCE = 3.0  # [s] of wall time for an answer

Answer = Callable[[Any, str], None]


class Services:
    """Clients of one node, kept once made. `look` hands out answers, in the caller's thread."""

    def __init__(self, node: Node):
        self._node = node
        self._clients: dict[str, Any] = {}
        self._open: list[tuple[Any, Any, float, Answer]] = []

    def client(self, kind: type, name: str) -> Any:
        """The client of the service `name`."""
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name)
        return self._clients[name]

    def ready(self, kind: type, name: str) -> bool:
        """Whether somebody offers it."""
        return self.client(kind, name).service_is_ready()

    def call(self, kind: type, name: str, request: Any, answer: Answer) -> None:
        """Call it; answer(response, "") or answer(None, why not) comes later, from `look`."""
        client = self.client(kind, name)
        if not client.service_is_ready():
            answer(None, f"{name} is not there")
            return
        end = time.monotonic() + PATIENCE
        self._open.append((client, client.call_async(request), end, answer))

    def look(self) -> None:
        """Hand out what has come."""
        now = time.monotonic()
        still, self._open = self._open, []
        for client, future, end, answer in still:
            if future.done():
                answer(future.result(), "")
            elif now > end:
                client.remove_pending_request(future)
                answer(None, f"{client.srv_name} does not answer")
            else:
                self._open.append((client, future, end, answer))
