"""A spin loop whose cost per message is a few microseconds.

rclpy's SingleThreadedExecutor gathers every entity of the node, builds a wait set, a task and a
coroutine for each callback: 50 to 170 µs a message, five times the price of the message itself.
A control node's entities hardly ever change after its start, so `LeanExecutor` keeps a wait set of
its subscriptions and calls the callbacks of ready ones directly. What is rare (services, timers,
events of the middleware) is looked for fifty times a second, and handed to a
SingleThreadedExecutor, which knows how to serve it.

`WaitSet` is not public in rclpy. Where it is missing, `spin` falls back to the
SingleThreadedExecutor alone: slower, otherwise the same.
"""

import time
from collections.abc import Callable

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

try:
    from rclpy.impl.implementation_singleton import rclpy_implementation

    WaitSet = rclpy_implementation.WaitSet
except (ImportError, AttributeError):
    WaitSet = None


REST_PERIOD = 0.02  # [s] between two looks at services, timers and events


class LeanExecutor:
    """Spins one node, whose subscriptions, services and timers were made before.

    Messages are delivered in the order of the node's subscriptions within one wake-up. A callback
    that raises ends `spin` with that exception.

    A node with `defer` and `settle` is asked to settle after each wake-up, when all that had
    arrived has been delivered: it then acts on the newest, and skips ticks when it is behind.
    """

    def __init__(self, node: Node):
        self._node = node
        self._rest = SingleThreadedExecutor(context=node.context)
        self._rest.add_node(node)
        self._settle = getattr(node, "settle", lambda: None)
        if hasattr(node, "defer"):
            node.defer()
        self._next_look = 0.0
        self._gather()

    def _gather(self) -> None:
        """Take note of the node's entities and make the wait sets for them."""
        node, context = self._node, self._node.context.handle
        self._subscriptions = [
            (s.handle, s.msg_type, s.raw, s.callback, s.handle.pointer) for s in node.subscriptions
        ]
        self._services = [s.handle for s in node.services]
        self._clients = [c.handle for c in node.clients]
        self._timers = [t.handle for t in node.timers]
        self._waitables = list(node.waitables)
        events = sum(waitable.get_num_entities().num_events for waitable in self._waitables)
        counts = (len(self._timers), len(self._clients), len(self._services), events)
        self._messages = WaitSet(len(self._subscriptions), 0, 0, 0, 0, 0, context)
        self._others = WaitSet(0, 0, *counts, context)

    def spin_once(self, timeout: float) -> None:
        """Serve what is ready, waiting at most `timeout` seconds for a message.

        Shorter than `timeout` by itself when it is time to look for services and timers.
        """
        left = self._next_look - time.monotonic()
        if left <= 0.0:
            self._serve_others()
            left = REST_PERIOD
            self._next_look = time.monotonic() + left
        messages = self._messages
        messages.clear_entities()
        for handle, *_ in self._subscriptions:
            messages.add_subscription(handle)
        messages.wait(int(min(timeout, left) * 1e9))
        arrived = messages.get_ready_entities("subscription")
        for handle, kind, raw, callback, pointer in self._subscriptions:
            while pointer in arrived:
                taken = handle.take_message(kind, raw)
                if taken is None:
                    break
                callback(taken[0])
        self._settle()

    def _serve_others(self) -> None:
        """Serve services, clients, timers and events that are ready now."""
        others = self._others
        others.clear_entities()
        for handle in self._services:
            others.add_service(handle)
        for handle in self._clients:
            others.add_client(handle)
        for handle in self._timers:
            others.add_timer(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(others)
        others.wait(0)
        ready = [
            entity
            for kind in ("service", "client", "timer")
            for entity in others.get_ready_entities(kind)
        ]
        ready += [waitable for waitable in self._waitables if waitable.is_ready(others)]
        for _ in ready:
            self._rest.spin_once(timeout_sec=0)
        if ready:
            self._gather()  # a service may have changed them, as setting use_sim_time does

    def shutdown(self) -> None:
        """Let go of the node."""
        self._rest.shutdown()


def spin(node: Node, running: Callable[[], bool], wake_up: float = 0.1) -> None:
    """Serve `node` until `running()` is false, asked after every message and each `wake_up` s."""
    lean = LeanExecutor(node) if WaitSet is not None else None
    executor = lean or SingleThreadedExecutor(context=node.context)
    if lean is None:
        executor.add_node(node)
    step = lean.spin_once if lean else executor.spin_once
    try:
        while running() and node.context.ok():
            step(wake_up)
    finally:
        executor.shutdown()
