"""A spin loop with less work per message than rclpy's.

For each callback rclpy's SingleThreadedExecutor collects all entities of the node and builds a
wait set, a task and a coroutine. A control node's entities rarely change after its start, so
`LeanExecutor` reuses one wait set of its subscriptions and calls their callbacks directly.
`OtherEntities` serves the rest between two ticks.

benchmarks/executor.py measures a tick. rclpy's EventsExecutor (experimental) costs as little, but
has no point at which all received messages are delivered; `settle` needs one.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.subscription import Subscription

from uam_msgs_py.node.door import Door
from uam_msgs_py.node.other_entities import OtherEntities, WaitSet, wait_for
from uam_msgs_py.node.tick_times import DECODE, TAKE, NoTickTimes


class LeanExecutor:
    """Spins the nodes of a process; create their subscriptions, services and timers before.

    After a wake-up messages are delivered in the order of the nodes' subscriptions, triggers last.
    A message whose callback raises is refused, see `Door`; an exception of `settle` ends `spin`.

    If a node has `settle`, it is called after all received messages of a
    wake-up are delivered; the node then has its whole backlog.

    A wake-up costs more time than a tick. A node may therefore name the input that normally
    completes a tick (`triggers`): only this input wakes the node, and the others are read along. If
    a trigger arrived before another input of its tick (`stalled()`), any input wakes the node.

    If the first node has `process.busy_poll`, the loop looks for the input without sleeping for so
    long after each tick: the thread then needs no wake-up by the system. Its `times` measure the
    edges of the tick, those of other nodes begin with it.
    """

    def __init__(
        self,
        nodes: Node | Sequence[Node],
        triggers: Iterable[str] | None = None,
        stalled: Callable[[], bool] | None = None,
        at_rest: Callable[[], None] = lambda: None,
        often: Callable[[Subscription], bool] = lambda subscription: True,
    ):
        """triggers: names of topics; stalled: see class; None: those of the nodes.

        at_rest: called between two ticks, fifty times a second. often: whether the messages of a
        subscription are taken at each wake-up; those of others are taken between two ticks.
        """
        self._nodes = nodes if isinstance(nodes, Sequence) else [nodes]
        first, stalling = self._nodes[0], _those_of(self._nodes, "stalled")
        own = {name for node in self._nodes for name in getattr(node, "triggers", ())}
        self._trigger_names = own if triggers is None else set(triggers)
        self._stalled = stalled or (lambda: any(node_stalled() for node_stalled in stalling))
        self._doors = [
            getattr(node, "door", None) or Door(node, tells=True) for node in self._nodes
        ]
        self._rest = OtherEntities(self._nodes)
        self._settle = _those_of(self._nodes, "settle")
        self._at_rest, self._often = at_rest, often
        self._times = getattr(first, "times", NoTickTimes())
        every = (getattr(node, "times", self._times) for node in self._nodes)
        self._measuring = [times for times in every if type(times) is not NoTickTimes]
        process = getattr(first, "process", None)
        self._busy_poll = 0.0 if process is None else process.busy_poll
        self._gather()

    def _gather(self) -> None:
        """Collect the nodes' subscriptions and create the wait set."""
        nodes, triggers = self._nodes, self._trigger_names
        names = {node.resolve_topic_name(name) for node in nodes for name in triggers}
        every = [(s, d) for n, d in zip(nodes, self._doors, strict=True) for s in n.subscriptions]
        by_trigger = sorted(every, key=lambda one: one[0].topic_name in names)
        self._taken = [one for one in by_trigger if self._often(one[0])]
        self._rare = [one for one in by_trigger if not self._often(one[0])]
        self._triggers = [s.handle for s, _ in self._taken if s.topic_name in names]
        self._inputs = [s.handle for s, _ in self._taken]
        self._messages = WaitSet(len(self._inputs), 0, 0, 0, 0, 0, nodes[0].context.handle)

    def spin_once(self, timeout: float) -> None:
        """Serve all ready entities; wait for a message at most `timeout` [s].

        The wait is shorter if a check of services and timers is due.
        """
        stamp = max(getattr(node, "stamp", 0) for node in self._nodes)
        left = self._rest.left(stamp)
        if not left:
            self._deliver(self._rare)
            left, changed = self._rest.serve(stamp)
            self._at_rest()
            if changed:
                self._gather()
        for times in self._measuring:
            times.rest()
        # a driver has no inputs: it waits for its device in `settle`
        inputs = self._inputs if not self._triggers or self._stalled() else self._triggers
        wait_for(self._messages, inputs, min(timeout, left), self._busy_poll)
        for times in self._measuring:
            times.woken()
        self._deliver(self._taken)
        for settle in self._settle:
            settle()

    def _deliver(self, taken: Iterable[tuple[Subscription, Door]]) -> None:
        times = self._times
        for subscription, door in taken:
            for message in door.messages(subscription):
                times.lap(TAKE)
                door.accepts(subscription, subscription.callback, message)
                times.lap(DECODE)
        times.lap(TAKE)

    def shutdown(self) -> None:
        """Shut down the inner executor."""
        self._rest.shutdown()


def _those_of(nodes: Iterable[Node], name: str) -> list[Callable[[], Any]]:
    """Return the methods `name` of the nodes that have it."""
    return [getattr(node, name) for node in nodes if hasattr(node, name)]


def spin(
    nodes: Sequence[Node],
    running: Callable[[], bool],
    wake_up: float = 0.1,
    at_rest: Callable[[], None] = lambda: None,
    often: Callable[[Subscription], bool] = lambda subscription: True,
) -> None:
    """Spin `nodes` until `running()` is false, checked after messages and each `wake_up` [s].

    at_rest, often: see LeanExecutor.
    """
    executor = LeanExecutor(nodes, at_rest=at_rest, often=often)
    try:
        while running() and nodes[0].context.ok():
            executor.spin_once(wake_up)
    finally:
        executor.shutdown()
