"""Delivery of messages between the nodes of one process, without the middleware.

Every node still has its publishers and subscriptions in the ROS graph. What differs:

| topic | delivery |
|---|---|
| published and read in this process | the message object is given to the readers' callbacks |
| read by several nodes of this process | taken from the middleware once, given to each of them |
| published in this process | sent over the middleware by `send`, after the setpoint has left |

Who may publish a topic is decided as between processes (`rightful`). Only a reader whose rightful
publisher is in the process is served locally; of other publishers it refuses and names what comes
over the middleware, see `LocalPublisher`.

Topics that only nodes of this process need (`wiring`) are *inner* topics: they may be sent at a
lower rate (`thin`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.subscription import Subscription

from uam_control.settings.parameter_set import ParameterError
from uam_control.stamps import SECOND
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.serialized import stays_stamped
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node import wiring
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.rightful import PARAMETER, PUBLISHERS, Rightful, RightfulNodes, full_name
from uam_msgs_py.node.sole_publisher import LocalPublisher, SolePublisher
from uam_msgs_py.node.taking import identity
from uam_msgs_py.node.tick_times import DECODE, TAKE, NoTickTimes

UNREAD_DEPTH = 1  # of a subscription that is in the graph, but not read


class ReadingNode(Protocol):
    """What this module uses of `base_node.UamNode`."""

    rightful: RightfulNodes
    door: Door
    triggers: tuple[str, ...]

    def get_name(self) -> str: ...
    def get_namespace(self) -> str: ...
    def resolve_topic_name(self, topic: str) -> str: ...


class Outlet:
    """A publisher in a process with several nodes."""

    def __init__(self, delivery: LocalDelivery, publisher: Publisher, topic: Topic) -> None:
        self.publisher, self.topic = publisher, topic
        self.topic_name: str = publisher.topic_name
        self.readers: list[Callable[[Any], None]] = []
        self.queue: list[tuple[Publisher, Any]] | None = None  # None: sent at once
        self.period, self._sent = 0, -1  # [ns] least time between two messages sent, newest stamp
        self._delivery = delivery

    def publish(self, message: Any) -> None:
        """Give the message to the readers in this process; send it with the next `send`."""
        for reader in self.readers:
            reader(message)
        if self.period and not self._due(message):
            return
        if self.queue is None:
            self.publisher.publish(message)
        else:
            self.queue.append((self.publisher, message))

    def _due(self, message: bytes) -> bool:
        """Return whether a message is the first one of a period."""
        last, self._sent = self._sent, stamp_of(message)
        return self._sent // self.period != last // self.period

    def get_subscription_count(self) -> int:
        """Return the number of connected subscriptions, those in this process included."""
        there = self.publisher.get_subscription_count()
        return there if self._delivery.matched else there + len(self.readers)


class Inlet:
    """A subscription that is read for one or several nodes: `take` calls all `callbacks`."""

    def __init__(self, reader: _Reader) -> None:
        """reader: the first of them."""
        self.subscription, self._door = reader.subscription, reader.node.door
        self.callbacks = [reader.subscription.callback]
        self.times = NoTickTimes()  # of the process

    def take(self) -> None:
        """Deliver all received messages now, oldest first."""
        times = self.times
        for message in self._door.messages(self.subscription):
            times.lap(TAKE)
            for callback in self.callbacks:
                callback(message)
            times.lap(DECODE)

    @property
    def guard(self) -> SolePublisher | None:
        """Guard of the subscription, if any."""
        return self._door.guards.get(self.subscription)


class _Reader:
    """A subscription of a node, before `connect`."""

    def __init__(self, node: ReadingNode, name: str, subscription: Subscription) -> None:
        self.node, self.name, self.subscription = node, name, subscription
        self.rightful: Rightful | None = None if name not in PUBLISHERS else node.rightful.of(name)

    @property
    def topic(self) -> str:
        return self.subscription.topic_name


class LocalDelivery:
    """Connects the nodes of a process: give it to each of them, then call `connect`.

    `matched`: whether the middleware connects publishers and subscriptions of one process, too.
    `inlets`: what is to be taken from the middleware, by topic; `again`: whether a node has a
    message for which its turn in the tick was already over.
    """

    def __init__(self) -> None:
        self.matched = True
        self.again = False
        self.inlets: dict[str, Inlet] = {}
        self.watched: list[SolePublisher] = []  # guards of what is delivered locally
        self._all: list[Outlet] = []
        self._outlets: dict[str, Outlet] = {}  # of topics with one publisher
        self._nodes: dict[str, ReadingNode] = {}  # topic → its publisher
        self._readers: list[_Reader] = []
        self._local: dict[Subscription, Outlet] = {}
        self._sources: dict[Subscription, Inlet] = {}
        self._answers: list[tuple[Publisher, Any]] = []
        self._others: list[tuple[Publisher, Any]] = []

    def outlet(self, node: ReadingNode, topic: Topic, publisher: Publisher) -> Outlet:
        """Return what `node` publishes `topic` by."""
        made = Outlet(self, publisher, topic)
        self._all.append(made)
        if topic.name in PUBLISHERS:
            self._outlets[made.topic_name], self._nodes[made.topic_name] = made, node
        return made

    def reading(self, node: ReadingNode, topic: Topic, qos: QoSProfile) -> QoSProfile:
        """Return the quality of service of a further subscription; qos: that of the first.

        Messages that nobody takes are not stored.
        """
        name = node.resolve_topic_name(topic.name)
        if not any(one.topic == name for one in self._readers):
            return qos
        return QoSProfile(
            depth=UNREAD_DEPTH, reliability=qos.reliability, durability=qos.durability
        )

    def note(self, node: ReadingNode, name: str, subscription: Subscription) -> None:
        """Note a subscription of `node` to the topic `name`."""
        self._readers.append(_Reader(node, name, subscription))

    def connect(self, order: Sequence[ReadingNode] = ()) -> None:
        """Decide how each topic is delivered; all nodes have made their topics.

        order: the nodes as they act in a tick. Raises ParameterError.
        """
        position = {node: number for number, node in enumerate(order)}
        self._check_rightful()
        for reader in self._readers:
            outlet = self._outlets.get(reader.topic)
            if outlet is not None and self._publishes(reader):
                self._connect_locally(reader, outlet, position)
            else:
                self._share(reader)
        if self._local:
            self.matched = all(one.get_publisher_count() for one in self._local)
        own = {node.get_name() for node in self._nodes.values()}
        own |= {reader.node.get_name() for reader in self._readers}
        answered = {
            wire.topic.name for wire in wiring.WIRES if not set(wire.subscribers) <= own
        }  # topics that other processes need
        for outlet in self._all:
            outlet.queue = self._answers if outlet.topic.name in answered else self._others

    def _check_rightful(self) -> None:
        """Refuse readers of one topic that name different publishers. Raises ParameterError."""
        first: dict[str, _Reader] = {}
        for reader in self._readers:
            other = first.setdefault(reader.topic, reader)
            if other.rightful != reader.rightful:
                raise ParameterError(
                    f"{PARAMETER}: of {reader.topic} {other.node.get_name()} names "
                    f"{other.rightful.name}, {reader.node.get_name()} {reader.rightful.name}; "
                    "nodes of one process must name the same"
                )

    def _publishes(self, reader: _Reader) -> bool:
        """Return whether the rightful publisher of a reader's topic is in this process."""
        node = self._nodes[reader.topic]
        own = full_name(node.get_namespace(), node.get_name())
        return reader.rightful is not None and reader.rightful.name == own

    def _connect_locally(
        self, reader: _Reader, outlet: Outlet, position: dict[ReadingNode, int]
    ) -> None:
        subscription, node = reader.subscription, reader.node
        publisher = self._nodes[reader.topic]
        deliver = _converting(subscription)
        late = position.get(node, 0) <= position.get(publisher, 0)
        if late and reader.name in node.triggers:
            deliver = self._with_another_turn(deliver)
        outlet.readers.append(deliver)
        self._local[subscription] = outlet
        guard = LocalPublisher(node, subscription, publisher, identity(outlet.publisher))
        node.door.guards[subscription] = guard
        self.watched.append(guard)

    def _with_another_turn(self, deliver: Callable[[Any], None]) -> Callable[[Any], None]:
        def delivering(message: Any) -> None:
            self.again = True
            deliver(message)

        return delivering

    def _share(self, reader: _Reader) -> None:
        """Read a topic of another process for one more node."""
        subscription, node = reader.subscription, reader.node
        inlet = self.inlets.get(reader.topic)
        if inlet is None:
            inlet = self.inlets[reader.topic] = Inlet(reader)
        else:
            inlet.callbacks.append(subscription.callback)
            if inlet.guard is not None:
                node.door.guards[subscription] = inlet.guard
        self._sources[subscription] = inlet

    def take_waiting(self, subscription: Subscription) -> None:
        """Deliver all received messages of a node's subscription now."""
        source = self._sources.get(subscription)
        if source is not None:  # else delivered when it was published
            source.take()

    @property
    def known(self) -> set[Subscription]:
        """Return the subscriptions that are served by this object."""
        return {reader.subscription for reader in self._readers}

    def writers(self, subscription: Subscription) -> int:
        """Return the connected publishers that the middleware does not count."""
        return int(subscription in self._local and not self.matched)

    def thin(self, rate: float) -> None:
        """Send inner topics at most at this rate [Hz of their stamps]; 0: every message."""
        period = round(SECOND / rate) if rate else 0
        for outlet in self._outlets.values():
            inner = outlet.topic.name in PUBLISHERS and outlet.queue is self._others
            if inner and stays_stamped(outlet.topic.type):
                outlet.period = period

    def send_answers(self) -> None:
        """Send the messages that other processes wait for."""
        _send(self._answers)

    def send(self) -> None:
        """Send all other messages."""
        _send(self._answers)
        _send(self._others)


def _send(queue: list[tuple[Publisher, Any]]) -> None:
    for publisher, message in queue:
        publisher.publish(message)
    queue.clear()


def _converting(subscription: Subscription) -> Callable[[Any], None]:
    """Return the callback of a subscription for messages serialized or not."""
    callback, kind, raw = subscription.callback, subscription.msg_type, subscription.raw

    def deliver(message: Any) -> None:
        if isinstance(message, bytes):
            callback(message if raw else deserialize_message(message, kind))
        else:
            callback(serialize_message(message) if raw else message)

    return deliver
