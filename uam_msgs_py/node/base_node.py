"""What every node of the stack has in common: inputs, diagnostics, clean start, clean end."""

import gc
import re
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.serialized import stays_serialized
from uam_msgs_py.messages.status import ERROR, OK, STALE, WARN, diagnostic
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node import connections
from uam_msgs_py.node.executor import spin
from uam_msgs_py.node.health import LoopTime, ages
from uam_msgs_py.node.joins import StampJoin
from uam_msgs_py.node.node_parameters import refuse_unknown
from uam_msgs_py.node.tunable import TunableNode

DIAGNOSTICS_PERIOD = 1.0  # [s]
SAY_PERIOD = 2.0  # [s] between two lines of the same kind in the log


class UamNode(TunableNode):
    """A node that acts when messages arrive; it has no clock of its own.

    A subclass sets up with `publisher` and `listen`, and calls `done_tick` after each control tick.
    Timers run on the steady clock of the machine and only report: no state depends on them.
    """

    wake_up = 0.1  # [s] of wall time after which it looks around even if no trigger has come

    def __init__(self, name: str):
        super().__init__(name)
        self._required: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._arrivals: dict[str, float] = {}  # time.monotonic() of each input's newest message
        self._said: dict[str, float] = {}
        self._outlets: dict[str, Publisher] = {}
        self._inlets: dict[str, Subscription] = {}
        self.joins: list[StampJoin] = []
        self.triggers: tuple[str, ...] = ()  # topics that wake the node, () for all of them
        self.ticks = self.refused = 0
        self.deferred = False
        self._loop = LoopTime()
        self._at_last_report = (0, 0.0)
        self._dropped_before = 0
        self._waiting: list[str] = []
        self._diagnostics = self.publisher(topics.DIAGNOSTICS)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(SAY_PERIOD, self._look_for_inputs, clock=steady)
        self.create_timer(DIAGNOSTICS_PERIOD, self._report, clock=steady)

    def publisher(self, topic: Topic) -> Publisher:
        """Return a publisher of `topic`."""
        made = self._outlets[topic.name] = self.create_publisher(topic.type, topic.name, topic.qos)
        return made

    def listen(
        self,
        topic: Topic,
        handle: Callable[[Any], None],
        required: bool = True,
        qos: QoSProfile | None = None,
    ) -> Subscription:
        """Call `handle(message)` for each message; a BadMessage it raises is refused and said.

        The message comes serialized where uam_msgs_py.messages.serialized knows its type.
        required: the node reports that it waits while this input is silent. qos: if not what the
        stack's nodes ask for (`Topic.reading`).
        """
        counts, arrivals, name = self._counts, self._arrivals, topic.name
        counts[name] = 0
        if required:
            self._required[name] = 0

        def callback(message: Any) -> None:
            try:
                handle(message)
            except BadMessage as error:
                self.refused += 1
                self.say(f"{name}: refused: {error}", key=name)
                return
            counts[name] += 1
            arrivals[name] = time.monotonic()

        raw = stays_serialized(topic.type)
        made = self.create_subscription(topic.type, name, callback, qos or topic.reading, raw=raw)
        self._inlets[name] = made
        return made

    def take_waiting(self, subscription: Subscription) -> None:
        """Deliver at once what has arrived on `subscription`.

        Messages of one publishing process arrive in the order of publication. A node that acts on
        the last of them calls this for the others, and so has what was published before, although
        a spin loop may deliver topics in another order.
        """
        kind, raw = subscription.msg_type, subscription.raw
        while (taken := subscription.handle.take_message(kind, raw)) is not None:
            subscription.callback(taken[0])

    def defer(self) -> None:
        """From now on act in `settle`, when all that has arrived is delivered."""
        self.deferred = True
        for join in self.joins:
            join.deferred = True

    def stalled(self) -> bool:
        """Whether a trigger has come before the other inputs of its tick."""
        return any(join.incomplete_after(name) for join in self.joins for name in self.triggers)

    def settle(self) -> None:
        """Act on complete inputs; called when all that has arrived is delivered."""
        for join in self.joins:
            join.settle()

    def say(self, text: str, key: str | None = None) -> None:
        """Log a warning, the same kind (`key`) at most once in SAY_PERIOD."""
        now = time.monotonic()
        if now - self._said.get(key or text, -SAY_PERIOD) >= SAY_PERIOD:
            self._said[key or text] = now
            self.get_logger().warning(text)

    def done_tick(self, stamp: int, begun: float) -> None:
        """Note that the tick `stamp` [ns], begun at time.perf_counter() `begun`, is finished."""
        self.stamp = stamp
        self.ticks += 1
        self._loop.add(begun)

    @property
    def waiting_for(self) -> list[str]:
        """Required inputs that were silent when last looked for."""
        return self._waiting

    def _look_for_inputs(self) -> None:
        self._waiting = [
            name for name, before in self._required.items() if self._counts[name] == before
        ]
        self._required = {name: self._counts[name] for name in self._required}
        if self._waiting:
            names = [self.resolve_topic_name(name) for name in self._waiting]
            self.get_logger().info("waiting for " + ", ".join(names))

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Return level, summary and values of this node beyond the common ones; for subclasses."""
        return OK, "running", {}

    def _report(self) -> None:
        level, summary, values = self.diagnose()
        ticks, last = self._at_last_report
        now = time.monotonic()
        done = self.ticks - ticks
        dropped = sum(join.dropped for join in self.joins)
        self._at_last_report = (self.ticks, now)
        if self.waiting_for and level < ERROR:
            level, summary = STALE, "waiting for " + ", ".join(self.waiting_for)
        elif self.refused and level == OK:
            level, summary = WARN, f"{self.refused} messages refused"
        elif dropped > self._dropped_before and level == OK:
            level, summary = WARN, f"{dropped - self._dropped_before} ticks dropped of late"
        self._dropped_before = dropped
        common = {
            "ticks": self.ticks,
            "tick rate [Hz]": f"{done / (now - last):.1f}" if last else "",
            **self._loop.report(),
            "incomplete ticks dropped": dropped,
            "messages refused": self.refused,
        }
        common |= ages(self._counts, self._arrivals)
        common |= connections.of(self._outlets, self._inlets)
        stamp = self.stamp or self.get_clock().now().nanoseconds
        self._diagnostics.publish(
            diagnostic(stamp, self.get_name(), level, summary, common | values)
        )


class StopSignal:
    """Turns SIGINT and SIGTERM into a flag, however often they come.

    No exception is thrown into whatever runs, so nothing breaks half-way, the second Ctrl-C of an
    impatient user least of all.
    """

    def __init__(self):
        self.raised = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, *_):
        self.raised = True

    @staticmethod
    def ignore() -> None:
        """Let no signal harm what is left to do: ending the process.

        At its own end the interpreter gives handlers of Python back to the system, which would
        kill the process, and with it the exit status.
        """
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)


def run(make: Callable[[], UamNode], name: str) -> int:
    """Build a node and serve it until SIGINT or SIGTERM; return the exit status.

    0: stopped when asked; 1: the node gave up (its `failure`, if it has one, says why); 2: bad
    parameters or arguments, said in one line.
    """
    stop = StopSignal()
    try:
        # The context must outlive the signal, so that what a node says last is still sent.
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy's own classes for a bad parameter file or argument
        return refuse(name, error)
    node = None
    try:
        try:
            node = make()
            refuse_unknown(node)
        except (ValueError, OSError) as error:  # ParameterError, ProfileError, ScenarioError ...
            return refuse(name, error)
        gc.collect()
        gc.freeze()  # what lives now lives on: the collector need not look at it in flight
        spin(node, lambda: not stop.raised and not getattr(node, "failure", ""), node.wake_up)
        failure = getattr(node, "failure", "")
        if failure:
            print(f"{name}: {failure}", file=sys.stderr, flush=True)
        return 1 if failure else 0
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
        stop.ignore()


def refuse(name: str, error: Exception) -> int:
    """Say in one line why the node does not start; return its exit status, 2."""
    text = re.sub(r", at \S+:\d+", "", str(error))  # rcl appends the places in its own sources
    print(f"{name}: {' '.join(text.split())}", file=sys.stderr, flush=True)
    return 2
