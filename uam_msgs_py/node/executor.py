"""A spin loop with less work per message than rclpy's.

For each callback rclpy's SingleThreadedExecutor collects all entities of the node and builds a
wait set, a task and a coroutine. A control node's entities rarely change after its start, so
`LeanExecutor` reuses one wait set of its subscriptions and calls their callbacks directly. It
checks services, timers, clients and events only fifty times a second, of wall time or of tick
time. It serves at most one service request per check, so that many requests do not delay a tick.
Clients and events are passed to a SingleThreadedExecutor. Service requests are not: that executor
would serve waiting messages first.

benchmarks/executor.py measures a tick. rclpy's EventsExecutor (experimental) costs as little, but
has no point at which all received messages are delivered; `settle` needs one.
"""

import time
from collections.abc import Callable, Iterable

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.service import Service

from uam_msgs_py.node.tick_times import DECODE, TAKE, NoTickTimes
from uam_msgs_py.node.waiting import WaitSet, wait_for

REST_PERIOD = 0.02  # s between two checks of services, timers, clients and events
REST_STAMPS = round(REST_PERIOD * 1e9)  # ns of ticks: a simulation may run faster than wall time


class LeanExecutor:
    """Spins one node; create its subscriptions, services and timers before.

    After a wake-up messages are delivered in the order of the node's subscriptions, triggers last.
    An exception of a callback ends `spin`.

    If the node has `defer` and `settle`, `settle` is called after all received messages of a
    wake-up are delivered; the node then has its whole backlog.

    A wake-up costs more time than a tick. A node may therefore name the input that normally
    completes a tick (`triggers`): only this input wakes the node, and the others are read along. If
    a trigger arrived before another input of its tick (`stalled()`), any input wakes the node.

    If the node has `process.busy_poll`, the loop looks for the input without sleeping for so long
    after each tick: the thread then needs no wake-up by the system. Its `times` measure the edges
    of the tick.
    """

    def __init__(
        self,
        node: Node,
        triggers: Iterable[str] | None = None,
        stalled: Callable[[], bool] | None = None,
        at_rest: Callable[[], None] = lambda: None,
    ):
        """triggers: names of topics; stalled: see class; None: those of the node.

        at_rest: called between two ticks, fifty times a second.
        """
        self._node = node
        self._trigger_names = set(getattr(node, "triggers", ()) if triggers is None else triggers)
        self._stalled = stalled or getattr(node, "stalled", lambda: False)
        self._rest = SingleThreadedExecutor(context=node.context)
        self._rest.add_node(node)
        self._settle = getattr(node, "settle", lambda: None)
        if hasattr(node, "defer"):
            node.defer()
        self._next_check, self._checked_at = 0.0, 0
        self._at_rest = at_rest
        self._times = getattr(node, "times", NoTickTimes())
        process = getattr(node, "process", None)
        self._busy_poll = 0.0 if process is None else process.busy_poll
        self._gather()

    def _gather(self) -> None:
        """Collect the node's entities and create their wait sets."""
        node, context = self._node, self._node.context.handle
        names = {node.resolve_topic_name(name) for name in self._trigger_names}
        by_trigger = sorted(node.subscriptions, key=lambda s: s.topic_name in names)
        guards = getattr(node, "sole_publishers", {})
        self._subscriptions = [
            (guards.get(s, s.handle), s.msg_type, s.raw, s.callback) for s in by_trigger
        ]
        self._triggers = [s.handle for s in by_trigger if s.topic_name in names]
        self._inputs = [s.handle for s in by_trigger]
        self._services = [s.handle for s in node.services]
        self._clients = [c.handle for c in node.clients]
        self._timers = [t.handle for t in node.timers]
        self._waitables = list(node.waitables)
        events = sum(waitable.get_num_entities().num_events for waitable in self._waitables)
        counts = (len(self._timers), len(self._clients), len(self._services), events)
        self._messages = WaitSet(len(self._subscriptions), 0, 0, 0, 0, 0, context)
        self._others = WaitSet(0, 0, *counts, context)

    def spin_once(self, timeout: float) -> None:
        """Serve all ready entities; wait for a message at most `timeout` [s].

        The wait is shorter if a check of services and timers is due.
        """
        left = self._next_check - time.monotonic()
        stamp = getattr(self._node, "stamp", 0)
        if left <= 0.0 or stamp - self._checked_at >= REST_STAMPS:
            left = 0.0 if self._serve_others() else REST_PERIOD
            self._at_rest()
            self._next_check, self._checked_at = time.monotonic() + left, stamp
        times = self._times
        times.rest()
        # a driver has no inputs: it waits for its device in `settle`
        inputs = self._inputs if not self._triggers or self._stalled() else self._triggers
        wait_for(self._messages, inputs, min(timeout, left), self._busy_poll)
        times.woken()
        for handle, kind, raw, callback in self._subscriptions:
            while (taken := handle.take_message(kind, raw)) is not None:
                times.lap(TAKE)
                callback(taken[0])
                times.lap(DECODE)
        times.lap(TAKE)
        self._settle()

    def _serve_others(self) -> bool:
        """Serve ready services, clients, timers and events.

        Returns whether a service, client or event was ready.
        """
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
        services, timers = (set(others.get_ready_entities(kind)) for kind in ("service", "timer"))
        handed = list(others.get_ready_entities("client"))
        handed += [waitable for waitable in self._waitables if waitable.is_ready(others)]
        for _ in handed:
            self._rest.spin_once(timeout_sec=0)
        for timer in (t for t in self._node.timers if t.handle.pointer in timers):
            timer.handle.call_timer()
            timer.callback()
        request = next((s for s in self._node.services if s.handle.pointer in services), None)
        if request is not None:
            self._answer(request)
        if handed or services:
            self._gather()  # a service may change the entities, e.g. by setting use_sim_time
        return bool(handed or services)

    @staticmethod
    def _answer(service: Service) -> None:
        """Take one request and send the response."""
        request, header = service.handle.service_take_request(service.srv_type.Request)
        if header is not None:
            response = service.callback(request, service.srv_type.Response())
            service.send_response(response, header)

    def shutdown(self) -> None:
        """Shut down the inner executor."""
        self._rest.shutdown()


def spin(
    node: Node,
    running: Callable[[], bool],
    wake_up: float = 0.1,
    at_rest: Callable[[], None] = lambda: None,
) -> None:
    """Spin `node` until `running()` is false, checked after messages and each `wake_up` [s].

    at_rest: see LeanExecutor.
    """
    executor = LeanExecutor(node, at_rest=at_rest)
    try:
        while running() and node.context.ok():
            executor.spin_once(wake_up)
    finally:
        executor.shutdown()
