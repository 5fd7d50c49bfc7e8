"""Publishers and subscribers of each topic in a flight, and whether they are connected.

A lockstep flight is reproducible only if no node misses its first tick. The plant therefore waits
until both ends of every wire report it: of each topic of the table with nodes that need it. A test
compares them with the running nodes.

The ROS graph lists publishers and subscriptions, but not whether the two ends are connected yet;
before that messages are lost. Only the ends themselves count their connections, in /diagnostics.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.node_names import (  # noqa: F401  for all that speak of wires
    ARM,
    ARM_DRIVER,
    ATTITUDE,
    BRIDGE,
    CHECKLIST,
    COCKPIT,
    CONTROLLERS,
    ESTIMATOR,
    FLIGHT,
    FLIGHT_CONTROLLER,
    FUSED,
    MAGNET_DRIVER,
    MISSION,
    MOCAP_DRIVER,
    PLANT,
    POSITION,
    RECORDER,
    SCENE,
    WHOLE_BODY,
)
from uam_msgs_py.messages.status import finite
from uam_msgs_py.node.namespace import expanded, prefix

NAMELESS = "_NODE_NAME_UNKNOWN_"  # of the middleware, before it has a node's name
READERS, WRITERS = "readers of ", "writers of "


@dataclass(frozen=True)
class Wire:
    """A topic from one node to several; the recorder is added by `listeners`."""

    topic: topics.Topic
    publisher: str
    subscribers: tuple[str, ...] = ()
    optional: bool = False  # the subscribers also work without the topic

    def listeners(self, recorded: bool) -> tuple[str, ...]:
        """Return the subscribers, with the recorder if recorded."""
        return (*self.subscribers, RECORDER) if recorded else self.subscribers


WIRES = tuple(
    Wire(topic, topic.publisher, topic.to, topic.optional)
    for topic in topics.ALL
    if topic.to is not None
)


def reporting(recorded: bool, foreign: Collection[str] = ()) -> list[str]:
    """Return the nodes but the plant that a tick needs and that report in /diagnostics.

    recorded: see `missing`; foreign: nodes of the stack that the user replaces.
    """
    nodes = dict.fromkeys(wire.publisher for wire in WIRES)
    own = [one for one in nodes if one != PLANT and one not in foreign]
    return [*own, RECORDER] if recorded else own


def with_foreign(node: Node, foreign: Mapping[str, str]) -> Sequence[Wire]:
    """Return WIRES for a flight in which the user's own nodes replace others.

    foreign: node of the stack → name of the own one. It must publish the topics that other nodes
    require. Its own subscriptions are free; they are read from the ROS graph of `node`.
    """
    if not foreign:
        return WIRES
    found = []
    for wire in WIRES:
        if wire.publisher in foreign and (wire.optional or not wire.subscribers):
            continue
        listeners = _listeners(node, wire.topic)
        required = tuple(
            foreign.get(one, one)
            for one in wire.subscribers
            if one not in foreign or foreign[one] in listeners
        )
        publisher = foreign.get(wire.publisher, wire.publisher)
        found.append(replace(wire, publisher=publisher, subscribers=required))
    return found


def with_autopilot_imu(wires: Sequence[Wire]) -> Sequence[Wire]:
    """Return `wires` for a flight in which the bridge publishes the autopilot's IMU.

    Its stamps are those of the plant's clock.
    """
    changed = {topics.IMU: {"publisher": BRIDGE}, topics.CLOCK: {"subscribers": (BRIDGE,)}}
    return [replace(wire, **changed.get(wire.topic, {})) for wire in wires]


def with_odometry(wires: Sequence[Wire]) -> Sequence[Wire]:
    """Return `wires` for a flight whose poses are those of an odometry."""
    changed = {topics.MOCAP: {"topic": topics.ODOMETRY_IN}}
    return [replace(wire, **changed.get(wire.topic, {})) for wire in wires]


def on_vehicle(publishers: Mapping[str, str], subscribers: Mapping[str, str]) -> list[Wire]:
    """Return WIRES of a vehicle, on which devices stand in place of the plant.

    publishers, subscribers: topic of the plant → node that publishes it, or subscribes to it. A
    topic that is not named has no such node.
    """
    found = []
    for wire in WIRES:
        name = wire.topic.name
        if wire.publisher == PLANT and name not in publishers:
            continue
        listening = (subscribers.get(name) if one == PLANT else one for one in wire.subscribers)
        publisher = publishers[name] if wire.publisher == PLANT else wire.publisher
        found.append(replace(wire, publisher=publisher, subscribers=tuple(filter(None, listening))))
    return found


def _listeners(node: Node, topic: topics.Topic) -> list[str]:
    """Return the names of the vehicle's nodes that subscribe to `topic`."""
    name = node.resolve_topic_name(topic.name)
    return _own(node, node.get_subscriptions_info_by_topic(name))


def _own(node: Node, ends: Sequence[TopicEndpointInfo]) -> list[str]:
    """Return the names of the nodes of `ends` that are in the namespace of `node`."""
    return [end.node_name for end in ends if end.node_namespace == node.get_namespace()]


def missing(node: Node, recorded: bool, wires: Sequence[Wire] = WIRES) -> list[str]:
    """Return one text per end of `wires` that the ROS graph of `node` does not contain yet.

    A publisher that is there twice has a text, too: one may be of an earlier flight.

    recorded: the recorder must subscribe to each of these topics as well.
    """
    found = []
    for wire in wires:
        name = node.resolve_topic_name(wire.topic.name)
        publishers = _own(node, node.get_publishers_info_by_topic(name))
        listeners = _listeners(node, wire.topic)
        if wire.publisher not in publishers:
            found.append(f"{wire.publisher} to publish {name}")
        if publishers.count(wire.publisher) > 1:
            found.append(f"one of the two nodes named {wire.publisher} that publish {name} to end")
        required = wire.listeners(recorded)
        found += [f"{one} to listen to {name}" for one in required if one not in listeners]
    return found


def publishers(node: Node) -> dict[str, int]:
    """Return the number of publishers of each topic that its subscriptions can connect to.

    A foreign publisher counts, too: its connection must not be taken for that of the own one.
    """
    found = {}
    for wire in WIRES:
        ends = node.get_publishers_info_by_topic(node.resolve_topic_name(wire.topic.name))
        fit = [qos_check_compatible(end.qos_profile, wire.topic.reading)[0] for end in ends]
        found[wire.topic.name] = sum(one != QoSCompatibility.ERROR for one in fit)
    return found


def unconnected(
    reported: Connections,
    plant: Mapping[str, int],
    recorded: bool,
    wires: Sequence[Wire] = WIRES,
    foreign: Collection[str] = (),
    namespace: str = "/",
    writers: Mapping[str, int] | None = None,
) -> Iterator[str]:
    """Yield one text per end of `wires` that lacks a connection.

    reported: connections that the other nodes report; plant: those of the plant itself
    (`connections.of`); foreign: nodes without such reports; namespace: of the plant;
    writers: see `publishers`, None for one of each.
    """

    def count(node: str, kind: str, topic: str) -> int:
        if node == PLANT:
            return plant.get(kind + expanded(namespace, topic), 0)
        return reported.count(node, kind, topic)

    for wire in wires:
        name, required = wire.topic.name, wire.listeners(recorded)
        reports, shown = wire.publisher not in foreign, expanded(namespace, name)
        if reports and count(wire.publisher, READERS, name) < len(required):
            yield f"{wire.publisher} to connect to the subscribers of {shown}"
        for one in required:
            if one not in foreign and count(one, WRITERS, name) < (writers or {}).get(name, 1):
                yield f"{one} to connect to the publisher of {shown}"


def connection_counts(
    node: Node,
    outlets: Mapping[str, Publisher],
    inlets: Mapping[str, Subscription],
) -> dict[str, int]:
    """Return the diagnostic values: for each topic of `node`, its number of connected ends."""
    counts = {
        READERS: {name: outlet.get_subscription_count() for name, outlet in outlets.items()},
        WRITERS: {name: _writers(node, inlet) for name, inlet in inlets.items()},
    }
    return {
        kind + expanded(node.get_namespace(), name): count
        for kind, found in counts.items()
        for name, count in found.items()
    }


def _writers(node: Node, inlet: Subscription) -> int:
    """Return the number of connected publishers whose node name is known in the node's graph.

    The name may arrive after the connection; until then `SolePublisher` refuses the messages.
    """
    ends = node.get_publishers_info_by_topic(inlet.topic_name)
    named = sum(end.node_name != NAMELESS for end in ends)
    return min(inlet.get_publisher_count(), named)


class Connections:
    """Collects the diagnostic values of the nodes in the namespace of `node`.

    A node without diagnostics has no connections.

    Diagnostics are sent once a second, so the counts may be a second old.
    """

    def __init__(self, node: Node, spun: bool = True):
        """spun: `node` is spun; else its owner passes the messages by `note`."""
        self._values: dict[str, dict[str, str]] = {}
        self._reports: Counter[str] = Counter()
        self._namespace = node.get_namespace()
        if spun:
            topic = topics.DIAGNOSTICS
            node.create_subscription(topic.type, topic.name, self.note, topic.qos)

    def note(self, message: DiagnosticArray) -> None:
        """Take a message of /diagnostics."""
        for status in message.status:
            self._values[status.name] = {pair.key: pair.value for pair in status.values}
            self._reports[status.name] += 1

    def reports(self, node: str) -> int:
        """Return the number of reports of a node so far."""
        return self._reports[prefix(self._namespace) + node]

    def count(self, node: str, kind: str, topic: str) -> int:
        """Return the number of READERS or WRITERS (kind) of `topic` that `node` is connected to."""
        values = self._values.get(prefix(self._namespace) + node, {})
        return int(finite(values.get(kind + expanded(self._namespace, topic))) or 0)
