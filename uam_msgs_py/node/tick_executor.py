"""Spins the nodes of one process, which pass messages to each other, see `local_delivery`.

A wake-up is one pass: what has arrived is delivered, then the nodes act in the order of the tick.
The wake-up comes from the inputs of other processes that complete a tick, normally the IMU alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from rclpy.subscription import Subscription

from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.local_delivery import Inlet, LocalDelivery
from uam_msgs_py.node.other_entities import OtherEntities
from uam_msgs_py.node.rightful import PUBLISHERS
from uam_msgs_py.node.tick_times import PUBLISH, TAKE, NoTickTimes
from uam_msgs_py.node.waiting import WaitSet, wait_for


class TickExecutor:
    """Create it after `LocalDelivery.connect`.

    Topics of the control loop are read at every pass, triggers last. All others, goals and messages
    of foreign publishers, are read when services and timers are served, see `OtherEntities`.
    """

    def __init__(
        self,
        nodes: Sequence[UamNode],
        delivery: LocalDelivery,
        steps: Sequence[Callable[[], None]],
        done: Callable[[float], None],
        at_rest: Callable[[], None] = lambda: None,
    ) -> None:
        """nodes: the first one has the options of the process, and its times are those of a pass.

        steps: what one pass does after the delivery, in order. done(begun): called after a pass;
        begun: time.perf_counter() [s] at its wake-up. at_rest: called between two ticks, fifty
        times a second.
        """
        self._nodes, self._delivery, self._steps = nodes, delivery, steps
        self._done, self._at_rest = done, at_rest
        self._times, self._busy_poll = nodes[0].times, nodes[0].process.busy_poll
        # all nodes that measure begin their ticks with the process
        self._measuring = [node.times for node in nodes if type(node.times) is not NoTickTimes]
        self._wake_up = min(node.wake_up for node in nodes)
        for node in nodes:
            node.defer()
        triggers = {node.resolve_topic_name(name) for node in nodes for name in node.triggers}
        inlets = delivery.inlets
        loop = {node.resolve_topic_name(name) for node in nodes for name in PUBLISHERS}
        fast = sorted(inlets.keys() & loop, key=lambda name: (name in triggers, name))
        self._fast = [inlets[name] for name in fast]
        for inlet in self._fast:
            inlet.times = self._times
        self._slow = [inlet for name, inlet in inlets.items() if name not in loop]
        self._triggers = [inlets[name].subscription.handle for name in fast if name in triggers]
        self._every = [inlet.subscription.handle for inlet in self._fast]
        # nodes that join inputs of this process alone never wait for a message
        self._may_stall = [node for node in nodes if _joins_others(node, inlets)]
        self._rest = OtherEntities(nodes)
        self._messages = WaitSet(len(self._every), 0, 0, 0, 0, 0, nodes[0].context.handle)
        self._unknown: list[Subscription] = []
        self._gather()

    def _gather(self) -> None:
        """Collect subscriptions that the nodes have made later, as /clock for use_sim_time."""
        known = self._delivery.known
        self._unknown = [s for node in self._nodes for s in node.subscriptions if s not in known]

    def spin(self, running: Callable[[], bool]) -> None:
        """Spin until `running()` is false."""
        context = self._nodes[0].context
        try:
            while running() and context.ok():
                self.spin_once()
        finally:
            self._delivery.send()
            self._rest.shutdown()

    def spin_once(self, timeout: float | None = None) -> None:
        """Wait for a trigger, at most `timeout` [s] (None: as the nodes say), and make a pass."""
        left = self._between(self._wake_up if timeout is None else timeout)
        delivery = self._delivery
        for times in self._measuring:
            times.rest()
        if delivery.again:
            delivery.again = False
        else:
            stalled = any(node.stalled() for node in self._may_stall)
            inputs = self._every if stalled or not self._triggers else self._triggers
            wait_for(self._messages, inputs, left, self._busy_poll)
        for times in self._measuring:
            times.woken()
        begun = time.perf_counter()
        for inlet in self._fast:
            inlet.take()
        self._times.lap(TAKE)
        for step in self._steps:
            step()
        self._times.lap(PUBLISH)
        self._done(begun)

    def _between(self, timeout: float) -> float:
        """Serve what is due between two ticks; return the longest wait [s]."""
        stamp = max(node.stamp for node in self._nodes)
        left = self._rest.left(stamp)
        if left:
            return min(left, timeout)
        for inlet in self._slow:
            inlet.take()
        for guard in self._delivery.watched:
            guard.take()
        for subscription in self._unknown:
            for message in self._nodes[0].door.messages(subscription):
                self._nodes[0].door.accepts(subscription, subscription.callback, message)
        left, changed = self._rest.serve(stamp)
        self._at_rest()
        if changed:
            self._gather()
        self._delivery.send()
        return min(left, timeout)


def _joins_others(node: UamNode, inlets: Mapping[str, Inlet]) -> bool:
    """Return whether a node joins an input of another process."""
    joined = {node.resolve_topic_name(name) for join in node.joins for name in join.last_seen}
    return bool(joined & inlets.keys())
