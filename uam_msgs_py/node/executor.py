"""A spin loop with less work per message than rclpy's.

For each callback rclpy's SingleThreadedExecutor collects all entities of the node and builds a
wait set, a task and a coroutine. A control node's entities rarely change after its start, so
`LeanExecutor` reuses one wait set of its subscriptions and calls their callbacks directly.
`OtherEntities` serves the rest between two ticks.

benchmarks/executor.py measures a tick. rclpy's EventsExecutor (experimental) costs as little, but
has no point at which all received messages are delivered; `settle` needs one.
"""

from collections.abc import Callable, Iterable

from rclpy.node import Node

from uam_msgs_py.node.door import Door
from uam_msgs_py.node.other_entities import OtherEntities
from uam_msgs_py.node.tick_times import DECODE, TAKE, NoTickTimes
from uam_msgs_py.node.waiting import WaitSet, wait_for


class LeanExecutor:
    """Spins one node; create its subscriptions, services and timers before.

    After a wake-up messages are delivered in the order of the node's subscriptions, triggers last.
    A message whose callback raises is refused, see `Door`; an exception of `settle` ends `spin`.

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
        self._door = getattr(node, "door", None) or Door(node, tells=True)
        self._rest = OtherEntities([node])
        self._settle = getattr(node, "settle", lambda: None)
        if hasattr(node, "defer"):
            node.defer()
        self._at_rest = at_rest
        self._times = getattr(node, "times", NoTickTimes())
        process = getattr(node, "process", None)
        self._busy_poll = 0.0 if process is None else process.busy_poll
        self._gather()

    def _gather(self) -> None:
        """Collect the node's subscriptions and create their wait set."""
        node = self._node
        names = {node.resolve_topic_name(name) for name in self._trigger_names}
        by_trigger = sorted(node.subscriptions, key=lambda s: s.topic_name in names)
        self._subscriptions = by_trigger
        self._triggers = [s.handle for s in by_trigger if s.topic_name in names]
        self._inputs = [s.handle for s in by_trigger]
        self._messages = WaitSet(len(self._subscriptions), 0, 0, 0, 0, 0, node.context.handle)

    def spin_once(self, timeout: float) -> None:
        """Serve all ready entities; wait for a message at most `timeout` [s].

        The wait is shorter if a check of services and timers is due.
        """
        stamp = getattr(self._node, "stamp", 0)
        left = self._rest.left(stamp)
        if not left:
            left, changed = self._rest.serve(stamp)
            self._at_rest()
            if changed:
                self._gather()
        times = self._times
        times.rest()
        # a driver has no inputs: it waits for its device in `settle`
        inputs = self._inputs if not self._triggers or self._stalled() else self._triggers
        wait_for(self._messages, inputs, min(timeout, left), self._busy_poll)
        times.woken()
        door = self._door
        for subscription in self._subscriptions:
            for message in door.messages(subscription):
                times.lap(TAKE)
                door.accepts(subscription, subscription.callback, message)
                times.lap(DECODE)
        times.lap(TAKE)
        self._settle()

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
