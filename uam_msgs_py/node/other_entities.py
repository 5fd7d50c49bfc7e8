"""Services, timers, clients and events of nodes, served between two ticks.

They are checked fifty times a second, of wall time or of tick time, events once a second of wall
time. At most one service request and one report (timer of REPORT_PERIOD or more) is served per
check, so that many do not delay a tick. Services are asked one by one: a wait set needs ten
microseconds for each entity, asking takes one. The seven that every node has take
turns: five times a second each. Clients and events are passed to a SingleThreadedExecutor. Service
requests are not: that executor would serve waiting messages first.
"""

import time
from collections.abc import Sequence
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.timer import Timer

from uam_msgs_py.node.answering import answered

WaitSet = rclpy_implementation.WaitSet  # not part of rclpy's public API
REST_PERIOD = 0.02  # s between two checks
REST_STAMPS = round(REST_PERIOD * 1e9)  # ns of ticks: a simulation may run faster than wall time
REPORT_PERIOD = 500_000_000  # ns, from which a timer's period is that of a report
EVENT_PERIOD = 1.0  # s between two checks of events, which only report
OF_EVERY_NODE = "rcl_interfaces", "type_description_interfaces"  # modules of their services
TURNS = 10  # checks in which each of these is asked once


def wait_for(
    messages: WaitSet, inputs: Sequence[Any], timeout: float, busy_poll: float = 0.0
) -> None:
    """Wait until one of `inputs` has a message, at most `timeout` [s].

    messages: a wait set for them; inputs: handles of subscriptions; without any it sleeps.
    busy_poll: time [s] in which it looks again and again before it sleeps; the message then needs
    no wake-up of this thread by the system.
    """
    if not inputs:
        time.sleep(timeout)
        return
    end = time.monotonic() + min(busy_poll, timeout) if busy_poll else 0.0
    asleep = not end
    while True:
        messages.clear_entities()
        for handle in inputs:
            messages.add_subscription(handle)
        messages.wait(int(timeout * 1e9) if asleep else 0)
        if asleep or messages.get_ready_entities("subscription"):
            return
        asleep = time.monotonic() >= end


class OtherEntities:
    """What nodes have besides subscriptions; create it before, as `gather` says."""

    def __init__(self, nodes: Sequence[Node]) -> None:
        self._nodes, self._context = nodes, nodes[0].context
        self._executor = SingleThreadedExecutor(context=self._context)
        for node in nodes:
            self._executor.add_node(node)
        self._next_check, self._checked_at, self._next_events = 0.0, 0, 0.0
        self._turn = 0
        self.gather()

    def gather(self) -> None:
        """Collect the nodes' entities; call it when they have changed."""
        nodes = self._nodes
        services = [service for node in nodes for service in node.services]
        shared = [one for one in services if one.srv_type.__module__.startswith(OF_EVERY_NODE)]
        own = [one for one in services if one not in shared]
        self._services = [[*own, *shared[turn::TURNS]] for turn in range(TURNS)]
        self._clients = [c.handle for node in nodes for c in node.clients]
        self._timers = [t for node in nodes for t in node.timers]
        self._waitables = [w for node in nodes for w in node.waitables]
        events = sum(waitable.get_num_entities().num_events for waitable in self._waitables)
        self._answers = WaitSet(0, 0, 0, len(self._clients), 0, 0, self._context.handle)
        self._events = WaitSet(0, 0, 0, 0, 0, events, self._context.handle)

    def left(self, stamp: int) -> float:
        """Return the time [s] until a check is due, 0: now; stamp [ns]: of the newest tick."""
        if stamp - self._checked_at >= REST_STAMPS:
            return 0.0
        return max(0.0, self._next_check - time.monotonic())

    def serve(self, stamp: int) -> tuple[float, bool]:
        """Serve what is ready.

        Returns the time [s] until the next check, and whether the nodes' entities may have changed:
        a service may do so, for example by setting use_sim_time.
        """
        served = self._serve()
        if served:
            self.gather()
        left = 0.0 if served else REST_PERIOD
        self._next_check, self._checked_at = time.monotonic() + left, stamp
        return left, served

    def _serve(self) -> bool:
        """Serve what is ready; return whether a service, client or event was."""
        handed = self._answered_clients()
        now = time.monotonic()
        if now >= self._next_events:
            self._next_events = now + EVENT_PERIOD
            handed += self._ready_events()
        for _ in range(handed):
            self._executor.spin_once(timeout_sec=0)
        self._call([timer for timer in self._timers if timer.handle.is_timer_ready()])
        return self._answer_one() or bool(handed)

    def _answer_one(self) -> bool:
        """Answer the first request of a service whose turn it is; return whether there was one.

        The turn ends with a check without a request.
        """
        if any(map(answered, self._services[self._turn])):
            return True
        self._turn = (self._turn + 1) % TURNS
        return False

    def _answered_clients(self) -> int:
        """Return the number of clients that have an answer."""
        if not self._clients:
            return 0
        answers = self._answers
        answers.clear_entities()
        for handle in self._clients:
            answers.add_client(handle)
        answers.wait(0)
        return len(answers.get_ready_entities("client"))

    @staticmethod
    def _call(ready: Sequence[Timer]) -> None:
        """Call timers; of those that report the first one only, the next check has the others."""
        reported = False
        for timer in ready:
            reports = timer.timer_period_ns >= REPORT_PERIOD
            if reports and reported:
                continue
            reported = reported or reports
            timer.handle.call_timer()
            timer.callback()

    def _ready_events(self) -> int:
        """Return the number of ready events."""
        if not self._waitables:
            return 0
        events = self._events
        events.clear_entities()
        for waitable in self._waitables:
            waitable.add_to_wait_set(events)
        events.wait(0)
        return sum(waitable.is_ready(events) for waitable in self._waitables)

    def shutdown(self) -> None:
        """Shut down the inner executor."""
        self._executor.shutdown()
