"""A spin loop whose cost per message is a few microseconds.

rclpy's SingleThreadedExecutor gathers every entity of the node, builds a wait set, a task and a
coroutine for each callback: 50 to 170 µs a message, five times the price of the message itself.
A control node's entities never change after start, so `LeanExecutor` keeps one wait set and calls
the callbacks of ready subscriptions directly. Whatever is rare (services, timers, events of the
middleware) is waited for in the same wait set and handed to a SingleThreadedExecutor, which knows
how to serve it.

`WaitSet` is not public in rclpy. Where it is missing or different, `spin` falls back to the
SingleThreadedExecutor alone: slower, otherwise the same.
"""

from collections.abc import Callable

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

try:
    from rclpy.impl.implementation_singleton import rclpy_implementation

    WaitSet = rclpy_implementation.WaitSet
except (ImportError, AttributeError):
    WaitSet = None


class LeanExecutor:
    """Spins one node, whose subscriptions, services and timers were made before.

    Messages are delivered in the order of the node's subscriptions within one wake-up. A callback
    that raises ends `spin` with that exception.
    """

    def __init__(self, node: Node):
        self._node = node
        self._rest = SingleThreadedExecutor(context=node.context)
        self._rest.add_node(node)
        self._gather()

    def _gather(self) -> None:
        """Take note of the node's entities and make the wait set for them."""
        node = self._node
        self._subscriptions = [
            (s.handle, s.msg_type, s.raw, s.callback, s.handle.pointer) for s in node.subscriptions
        ]
        self._services = [s.handle for s in node.services]
        self._clients = [c.handle for c in node.clients]
        self._timers = [t.handle for t in node.timers]
        self._waitables = list(node.waitables)
        self._wait_set = WaitSet(
            len(self._subscriptions),
            0,
            len(self._timers),
            len(self._clients),
            len(self._services),
            sum(waitable.get_num_entities().num_events for waitable in self._waitables),
            node.context.handle,
        )

    def spin_once(self, timeout: float) -> None:
        """Serve what is ready, waiting at most `timeout` seconds for something."""
        ready = self._wait_set
        ready.clear_entities()
        for handle, *_ in self._subscriptions:
            ready.add_subscription(handle)
        for handle in self._services:
            ready.add_service(handle)
        for handle in self._clients:
            ready.add_client(handle)
        for handle in self._timers:
            ready.add_timer(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(ready)
        ready.wait(int(timeout * 1e9))

        arrived = ready.get_ready_entities("subscription")
        for handle, kind, raw, callback, pointer in self._subscriptions:
            while pointer in arrived:
                taken = handle.take_message(kind, raw)
                if taken is None:
                    break
                callback(taken[0])
        if (
            (self._services and ready.get_ready_entities("service"))
            or (self._timers and ready.get_ready_entities("timer"))
            or (self._clients and ready.get_ready_entities("client"))
            or any(waitable.is_ready(ready) for waitable in self._waitables)
        ):
            self._rest.spin_once(timeout_sec=0)
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
