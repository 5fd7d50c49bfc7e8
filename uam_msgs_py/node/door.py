"""The one way of received messages into a program: what it cannot use is refused and counted.

Anyone may publish anything: bytes that are no message of the topic's type, other joint names or
their order, wrong lengths, numbers that are not finite, stamps of another clock. None of it ends a
program. The next good message is used.

Messages are taken serialized: rclpy would raise for bytes that are none, and the middleware would
discard them without a word.
"""

import sys
import time
import traceback
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from uam_control.settings.texts import visible
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.serialized import deserialized
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.rightful import PUBLISHERS, RightfulNodes
from uam_msgs_py.node.sole_publisher import UNKNOWN, SolePublisher, Taker, complaints, publishers

LOG_PERIOD = 2.0  # s, shortest time between two log lines of one kind
NAMES_PERIOD = 0.1  # s of wall time between two looks at who publishes a topic

T = TypeVar("T")


class Polled(CallbackGroup):
    """Callback group of subscriptions that no executor serves: it would discard their messages."""

    def can_execute(self, entity: Any) -> bool:
        """Return False: an executor leaves the entity alone."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Return False, as `can_execute`."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Do nothing: nothing was executed."""


class Refusals:
    """Counts the refused messages of each topic and sender."""

    def __init__(self) -> None:
        # topic, sender → count, newest reason, name of the node that may publish
        self._found: dict[tuple[str, str], tuple[int, str, str]] = {}

    def note(self, topic: str, sender: str, rightful: str, reason: str) -> None:
        """Count a message; topic: absolute name; sender, rightful: node names."""
        before = self._found.get((topic, sender))
        self._found[topic, sender] = (before[0] if before else 0) + 1, reason, rightful

    @property
    def count(self) -> int:
        """Number of refused messages."""
        return sum(count for count, _, _ in self._found.values())

    def texts(self) -> list[str]:
        """Return one line per topic and sender."""
        return [
            f"{topic}: refused {sender} ({count} messages): {reason}; publisher is {rightful}"
            for (topic, sender), (count, reason, rightful) in self._found.items()
        ]


class Door:
    """The messages of a node's subscriptions. The node announces `news` in /diagnostics and
    its log."""

    def __init__(self, node: Node, tells: bool = False):
        """tells: a refusal is logged here, for a node without /diagnostics."""
        self.guards: dict[Subscription, SolePublisher] = {}  # where there is a rightful publisher
        self.refusals = Refusals()
        self._node, self._tells = node, tells
        self._takers: dict[Subscription, Taker] = {}  # of the others
        # topic → when looked [s], who publishes it: gid → node
        self._names: dict[str, tuple[float, dict[bytes, str]]] = {}
        self._before: list[str] = []  # complaints at the last news
        self._logged: dict[str, float] = {}

    def listen(
        self,
        topic: Topic,
        qos: QoSProfile | None = None,
        raw: bool = False,
        rightful: RightfulNodes | None = None,
        works: Callable[[], bool] = lambda: False,
    ) -> Subscription:
        """Return a subscription whose messages the program takes when it needs them.

        qos: None for the topic's; raw: serialized messages; rightful, works: see `guard`.
        """
        made = self._node.create_subscription(
            *(topic.type, topic.name, lambda _: None, qos or topic.qos),
            raw=raw,
            callback_group=Polled(),
        )
        return made if rightful is None else self.guard(made, topic.name, rightful, works)

    def guard(
        self,
        subscription: Subscription,
        name: str,
        rightful: RightfulNodes,
        works: Callable[[], bool],
    ) -> Subscription:
        """Take only the rightful node's messages, if the topic has one; see SolePublisher."""
        if name in PUBLISHERS:
            self.guards[subscription] = SolePublisher(
                self._node, subscription, rightful.of(name), works
            )
        return subscription

    def forget(self, subscription: Subscription) -> None:
        """Take no more messages of a subscription that will be destroyed."""
        self.guards.pop(subscription, None)
        self._takers.pop(subscription, None)

    def taken(self, subscription: Subscription) -> Iterator[tuple[Any, dict[str, int]]]:
        """Take and yield the received messages (serialized if raw) and times, oldest first."""
        taker = self.taker(subscription)
        source = self.guards.get(subscription) or taker
        kind, raw = subscription.msg_type, subscription.raw
        while (message := source.take()) is not None:
            times = taker.times
            if not raw:
                try:
                    message = deserialized(message, kind)
                except BadMessage as error:
                    self.refuse(subscription, error)
                    continue
            yield message, times

    def messages(self, subscription: Subscription) -> Iterator[Any]:
        """Take and yield the received messages, oldest first."""
        for message, _ in self.taken(subscription):
            yield message

    def decoded(self, subscription: Subscription, decode: Callable[[Any], T]) -> Iterator[T]:
        """Yield `decode(message)` of each received message that it accepts."""
        found: list[T] = []
        for message in self.messages(subscription):
            if self.accepts(subscription, lambda one: found.append(decode(one)), message):
                yield found.pop()

    def accepts(
        self, subscription: Subscription, handle: Callable[..., object], *given: Any
    ) -> bool:
        """Call `handle(*given)` for a message; refuse it and return False if that raises."""
        try:
            handle(*given)
        except Exception as error:
            self.refuse(subscription, error)
            return False
        return True

    def refuse(self, subscription: Subscription, error: Exception) -> None:
        """Count a message that cannot be used; the next news name topic and sender."""
        topic, guard = subscription.topic_name, self.guards.get(subscription)
        if guard is None:
            sender = rightful = self.sender(subscription)
        else:
            sender, rightful = guard.rightful, guard.publisher
        expected = isinstance(error, BadMessage)
        reason = str(error if expected else BadMessage(f"{type(error).__name__}: {error}"))
        self.refusals.note(topic, sender, rightful, reason)
        if not expected and self.due(f"{topic} {type(error).__name__}"):
            for line in "".join(traceback.format_exception(error)).splitlines():
                print(visible(line), file=sys.stderr, flush=True)  # perhaps an error of the program
        if self._tells and self.due(topic):
            self._node.get_logger().warning(f"{topic}: message refused: {reason}")

    def due(self, key: str) -> bool:
        """Return whether a log line of this kind may be written now: one per LOG_PERIOD."""
        now = time.monotonic()
        if now - self._logged.get(key, -LOG_PERIOD) < LOG_PERIOD:
            return False
        self._logged[key] = now
        return True

    def news(self) -> list[str]:
        """Return one line per topic with foreign publishers or refused messages since last time."""
        now = [*complaints(self.guards.values()), *self.refusals.texts()]
        before, self._before = self._before, now
        return [text for text in now if text not in before]

    def values(self) -> dict[str, object]:
        """Return the diagnostic values."""
        return {
            "messages refused": self.refusals.count,
            "unusable messages": "; ".join(self.refusals.texts()),
            "foreign publishers": "; ".join(complaints(self.guards.values())),
        }

    def sender(self, subscription: Subscription) -> str:
        """Return the node that sent the last message of a topic that several may publish.

        Who publishes it is looked up at most every NAMES_PERIOD.
        """
        topic, gid = subscription.topic_name, bytes(self.taker(subscription).gid)
        looked, names = self._names.get(topic, (-NAMES_PERIOD, {}))
        if gid not in names and time.monotonic() - looked >= NAMES_PERIOD:
            names = publishers(self._node, topic)
            self._names[topic] = time.monotonic(), names
        return names.get(gid, UNKNOWN)

    def taker(self, subscription: Subscription) -> Taker:
        """Return what takes the messages of a subscription, the guard's if it has one."""
        if guard := self.guards.get(subscription):
            return guard.taker
        made = self._takers.get(subscription)
        if made is None:
            made = self._takers[subscription] = Taker(subscription)
        return made
