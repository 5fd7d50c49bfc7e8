"""Base class of all nodes: inputs, diagnostics, start and end of the process."""

import faulthandler
import re
import signal
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from uam_control.settings.parameter_set import ParameterError
from uam_control.settings.process_parameters import ProcessParameters, TickTimesParameters
from uam_control.settings.texts import visible
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.serialized import stays_serialized, stays_stamped
from uam_msgs_py.messages.status import ERROR, OK, STALE, WARN, diagnostic
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node import log_callers, process_options, wiring
from uam_msgs_py.node.door import LOG_PERIOD, Polled
from uam_msgs_py.node.double import STARTED, Double
from uam_msgs_py.node.executor import spin
from uam_msgs_py.node.health import LoopTime, StampWatch, ages
from uam_msgs_py.node.joins import StampJoin
from uam_msgs_py.node.namespace import adopt_sections, expanded, label
from uam_msgs_py.node.node_parameters import NodeParameters, refuse_unknown
from uam_msgs_py.node.process_options import GarbageCollection
from uam_msgs_py.node.rightful import PUBLISHERS, rightful_nodes
from uam_msgs_py.node.tick_times import tick_times
from uam_msgs_py.node.tunable import TunableNode

DIAGNOSTICS_PERIOD = 1.0  # s
END_PATIENCE = 6.0  # s, for the middleware at a node's end; `uam fly` waits 10 s
REFUSED = 2  # exit status

N = TypeVar("N", bound=Node)


class UamNode(TunableNode):
    """A node that acts on messages, not on timers.

    A subclass creates its topics by `publisher` and `listen` and calls `done_tick` after each
    control tick. Timers run on the machine's steady clock and only report: no state depends on
    them.
    """

    wake_up = 0.1  # s of wall time, longest wait for a trigger
    failure = ""  # why the node ends by itself

    def __init__(self, name: str):
        super().__init__(name)
        self.process = NodeParameters(self, ProcessParameters, read_only=True).current
        self.times = tick_times(NodeParameters(self, TickTimesParameters, read_only=True).current)
        self._required: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._arrivals: dict[str, float] = {}  # time.monotonic() of each input's newest message
        self.outlets: dict[str, Publisher] = {}
        self.inlets: dict[str, Subscription] = {}
        self._handles: dict[str, Callable[[Any], None]] = {}  # of the inlets
        self.rightful = rightful_nodes(self)
        self._stamps = StampWatch()
        self.joins: list[StampJoin] = []
        self.triggers: tuple[str, ...] = ()  # topics that wake the node, () for all of them
        self.ticks = 0
        self._loop = LoopTime()
        self._double = Double(self)
        self._at_last_report = (0, 0.0)
        self._dropped_before = 0
        self._waiting: list[str] = []  # required inputs without a message in the last LOG_PERIOD
        self.guards_end = False  # see `destroy_node`
        self._diagnostics = self.publisher(topics.DIAGNOSTICS)
        self.every(LOG_PERIOD, self._check_inputs)
        self.every(DIAGNOSTICS_PERIOD, self._report)

    def every(self, period: float, call: Callable[[], None]) -> None:
        """Call `call()` every `period` [s] of the machine's steady clock."""
        self.create_timer(period, call, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publisher(self, topic: Topic) -> Publisher:
        """Return a publisher of `topic`."""
        made = self.outlets[topic.name] = topic.outlet(self)
        self.times.watch(made, topic)
        return made

    def listen(
        self,
        topic: Topic,
        handle: Callable[[Any], None],
        required: bool = True,
        qos: QoSProfile | None = None,
        raw: bool = False,
    ) -> Subscription:
        """Call `handle(message)` for each message; if it raises, refuse the message.

        The message is serialized if `raw`, or if uam_msgs_py.messages.serialized reads its type.
        required: the node reports that it waits while no message arrives. qos: None for
        `Topic.reading`.
        """
        counts, arrivals, name = self._counts, self._arrivals, topic.name
        counts[name], self._handles[name] = 0, handle
        if required:
            self._required[name] = 0

        stamped = name in PUBLISHERS and stays_stamped(topic.type)

        def checked(message: Any) -> None:
            if stamped:
                self._check_stamp(name, stamp_of(message))
            self._handles[name](message)

        def callback(message: Any) -> None:
            if self.door.accepts(made, checked, message):
                counts[name] += 1
                arrivals[name] = time.monotonic()

        raw = raw or stays_serialized(topic.type)
        made = self.inlets[name] = self.create_subscription(
            topic.type,
            name,
            callback,
            qos or topic.reading,
            raw=raw,
            callback_group=Polled(),
        )
        self.door.guard(made, name, self.rightful, lambda: self.ticks > 0)
        self._stamps.listen(name)
        return made

    def handle_by(self, topic: Topic, handle: Callable[[Any], None]) -> None:
        """Call `handle(message)` from now on for each message of `topic`, to which it listens."""
        self._handles[topic.name] = handle

    def _check_stamp(self, name: str, stamp: int) -> None:
        clock = self.inlets.get(self._stamps.clock)
        guard = None if clock is None else self.door.guards.get(clock)
        self._stamps.check(name, stamp, "" if guard is None else guard.publisher)

    def take_waiting(self, subscription: Subscription) -> None:
        """Deliver all received messages of `subscription` now.

        Messages of one process arrive in the order of publication, but a spin loop may deliver
        topics in another order. A node that acts on the last message of a tick calls this first for
        its other inputs.
        """
        for message in self.door.messages(subscription):
            subscription.callback(message)

    def stalled(self) -> bool:
        """Return whether a trigger arrived before the other inputs of its tick."""
        return any(join.incomplete_after(name) for join in self.joins for name in self.triggers)

    def settle(self) -> None:
        """Act on complete ticks; called after all received messages are delivered."""
        for join in self.joins:
            join.settle()

    def note(self, text: str, odd: bool) -> None:
        """Log a text; odd: as a warning. rclpy requires one severity per line of code."""
        if odd:
            self.get_logger().warning(text)
        else:
            self.get_logger().info(text)

    def warn(self, text: str, key: str | None = None) -> None:
        """Log a warning, at most once per LOG_PERIOD for each `key` (default: the text)."""
        if self.door.due(key or text):
            self.get_logger().warning(text)

    @property
    def dropped(self) -> int:
        """Number of ticks without an answer."""
        return sum(join.dropped for join in self.joins)

    def done_tick(self, stamp: int, begun: float) -> None:
        """Count the tick `stamp` [ns] as done; begun: time.perf_counter() [s] at its start."""
        self.stamp = stamp
        self.ticks += 1
        self._loop.add(begun)
        self.times.tick(stamp)

    def _check_inputs(self) -> None:
        self._waiting = [
            name for name, before in self._required.items() if self._counts[name] == before
        ]
        self._required = {name: self._counts[name] for name in self._required}
        if self._waiting:
            names = [self.resolve_topic_name(name) for name in self._waiting]
            self.get_logger().info("waiting for " + ", ".join(names))

    def destroy_node(self) -> None:
        """Destroy the node; a subclass ends its own work before.

        The middleware may hang here when other nodes end at the same moment. In a process of
        `run` it is then ended after END_PATIENCE: exit status 1, and where it hung on stderr.
        """
        if self.guards_end:
            faulthandler.dump_traceback_later(END_PATIENCE, exit=True)
        super().destroy_node()

    def _doubled(self) -> str:
        """Return what to report while another node has this name; listen whether it lives."""
        if not self._double.seen():
            return ""
        reports = self.inlets.get(topics.DIAGNOSTICS.name)
        if reports is not None:  # the loop does not wait for what it did not begin with
            self.take_waiting(reports)
        elif self._double.young:
            self.listen(topics.DIAGNOSTICS, self._on_report, required=False)
        return f"another node is named {self.get_fully_qualified_name()}"

    def _on_report(self, message: DiagnosticArray) -> None:
        self.failure = self.failure or self._double.note(message)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Return level, summary and further values for /diagnostics; overridden by subclasses."""
        return OK, "running", {}

    def _report(self) -> None:
        level, summary, values = self.diagnose()
        ticks, last = self._at_last_report
        now = time.monotonic()
        done = self.ticks - ticks
        dropped, doubled = self.dropped, self._doubled()
        self._at_last_report = (self.ticks, now)
        if new := self.door.news():
            level, summary = ERROR, "; ".join(new)
            self.get_logger().error(summary)
        elif doubled and level < ERROR:
            level, summary = WARN, doubled
        elif self._waiting and level < ERROR:
            names = (expanded(self.get_namespace(), name) for name in self._waiting)
            level, summary = STALE, "waiting for " + ", ".join(names)
        elif dropped > self._dropped_before and level == OK:
            newly = dropped - self._dropped_before
            level, summary = WARN, f"{newly} ticks dropped since last report"
        self._dropped_before = dropped
        common = {
            STARTED: self._double.started,
            "ticks": self.ticks,
            "tick rate [Hz]": f"{done / (now - last):.1f}" if last else "",
            **self._loop.report(),
            "incomplete ticks dropped": dropped,
            **self.door.values(),
        }
        namespace = self.get_namespace()
        common |= ages(self._counts, self._arrivals, namespace)
        common |= wiring.connection_counts(self, self.outlets, self.inlets)
        stamp = self.stamp or self.get_clock().now().nanoseconds
        self._diagnostics.publish(diagnostic(stamp, label(self), level, summary, common | values))


class StopSignal:
    """Turns SIGINT and SIGTERM into the flag `raised`.

    No exception interrupts the running code, also not at a second Ctrl-C.
    """

    def __init__(self):
        self.raised = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, *_):
        self.raised = True

    @staticmethod
    def ignore() -> None:
        """Ignore further signals until the process ends.

        At exit the interpreter restores the system's handlers; a signal would then kill the process
        and change its exit status.
        """
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)


def run(make: Callable[[], UamNode], name: str) -> int:
    """Create a node and spin it until SIGINT or SIGTERM; return the exit status.

    0: stopped by a signal; 1: failure of the node (text in its `failure`); 2: bad parameters or
    arguments, with one line on stderr.
    """
    return run_together(
        lambda: [make()],
        name,
        lambda nodes, running, at_rest: spin(nodes, running, nodes[0].wake_up, at_rest),
    )


def run_together(
    make: Callable[[], Sequence[UamNode]],
    name: str,
    spin_them: Callable[[Sequence[UamNode], Callable[[], bool], Callable[[], None]], None],
) -> int:
    """Create the nodes of a process and spin them as `run` does; name: of the executable.

    spin_them(nodes, running, at_rest): spins until `running()` is false; at_rest: called between
    two ticks, fifty times a second. The first node has the options of the process.
    """
    stop = StopSignal()
    if not _initialized(name):
        return REFUSED
    nodes: Sequence[UamNode] = ()
    try:
        try:
            nodes = make()
            for node in nodes:
                refuse_unknown(node, node.get_name() if len(nodes) > 1 else "")
            process = nodes[0].process
            process_options.apply(process)
            log_callers.find_modules()
        except (ValueError, OSError) as error:  # ParameterError, ProfileError, ScenarioError ...
            return refuse(name, error)
        with GarbageCollection(process.collect_between_ticks) as garbage:
            spin_them(nodes, lambda: not stop.raised and not _failure_of(nodes), garbage.at_rest)
        failure = _failure_of(nodes)
        if failure:
            print(f"{name}: {failure}", file=sys.stderr, flush=True)
        return 1 if failure else 0
    finally:
        for node in nodes:
            node.times.close()
            node.guards_end = True
            node.destroy_node()
        rclpy.try_shutdown()
        stop.ignore()
        faulthandler.cancel_dump_traceback_later()


def run_with(name: str, work: Callable[[N], int], kind: type[N] = Node) -> int:
    """Create the node of a process that does not `run` one; return work(node), its exit status.

    2: bad arguments, parameter files or parameters, in one line on stderr.
    """
    if not _initialized(name):
        return REFUSED
    node = None
    try:
        node = kind(name)
        adopt_sections(node)  # a TunableNode has done so itself
        return work(node)
    except ParameterError as error:
        return refuse(name, error)
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def _initialized(name: str) -> bool:
    """Initialize ROS from the command line; return False after `refuse`."""
    try:
        # no handlers of rclpy: the context must still send the node's last messages
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy's own classes for a bad parameter file or argument
        refuse(name, error)
        return False
    return True


def _failure_of(nodes: Sequence[UamNode]) -> str:
    return next((node.failure for node in nodes if node.failure), "")


def refuse(name: str, error: Exception) -> int:
    """Print in one line why the node does not start; return its exit status, REFUSED."""
    text = re.sub(r", at \S+:\d+", "", str(error))  # rcl appends positions in its own sources
    print(visible(f"{name}: {' '.join(text.split())}"), file=sys.stderr, flush=True)
    return REFUSED
