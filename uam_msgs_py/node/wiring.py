"""Who talks to whom: which nodes of a flight publish and which subscribe to each topic.

A lockstep flight is the same from the first tick on only if everyone hears it. So the plant waits
until every connection listed here exists, as the nodes at both of its ends say. A test compares the
list with the running nodes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from rclpy.node import Node

from uam_msgs_py.messages import topics
from uam_msgs_py.node.connections import READERS, WRITERS, Connections

ESTIMATOR, MISSION = "state_estimator", "mission"
POSITION, ATTITUDE, ARM = "position_controller", "attitude_controller", "arm_controller"
BRIDGE, PLANT, RECORDER = "mavlink_bridge", "mujoco_sim", "recorder"
SCENE, COCKPIT = "scene", "cockpit"  # only look on, nobody waits for them: in none of WIRES


@dataclass(frozen=True)
class Wire:
    """One topic from one node to several; the recorder comes on top of them.

    optional: those who listen can do without.
    """

    topic: topics.Topic
    publisher: str
    subscribers: tuple[str, ...] = ()
    optional: bool = False

    def listeners(self, recorded: bool) -> tuple[str, ...]:
        """The subscribers, the recorder among them if it is there."""
        return (*self.subscribers, RECORDER) if recorded else self.subscribers


WIRES = (
    Wire(topics.IMU, PLANT, (ESTIMATOR,)),
    Wire(topics.JOINTS, PLANT, (ESTIMATOR, MISSION)),
    Wire(topics.MOCAP, PLANT, (ESTIMATOR, MISSION, BRIDGE)),
    Wire(topics.STATE, ESTIMATOR, (MISSION, POSITION, ATTITUDE, ARM, BRIDGE)),
    Wire(topics.REFERENCE, MISSION, (POSITION, ATTITUDE, ARM)),
    Wire(topics.MAGNET, MISSION, (PLANT,)),
    Wire(topics.ARMING, MISSION, (BRIDGE,)),
    Wire(topics.MISSION_STATUS, MISSION, (PLANT, BRIDGE)),
    Wire(topics.POSITION_COMMAND, POSITION, (ATTITUDE, ARM, BRIDGE)),
    Wire(topics.ATTITUDE_COMMAND, ATTITUDE, (BRIDGE,)),
    Wire(topics.ARM_EFFORT, ARM, (PLANT,)),
    Wire(topics.SETPOINT, BRIDGE, (PLANT,)),
    Wire(topics.AUTOPILOT_STATE, BRIDGE, (MISSION,)),
    Wire(topics.AUTOPILOT_BATTERY, BRIDGE, (MISSION,), optional=True),
    Wire(topics.POSITION_ADAPTATION, POSITION, (MISSION,), optional=True),
    Wire(topics.ATTITUDE_ADAPTATION, ATTITUDE, (MISSION,), optional=True),
    Wire(topics.ARM_ADAPTATION, ARM, (MISSION,), optional=True),
    # only recorded
    Wire(topics.CLOCK, PLANT),
    Wire(topics.TRUTH_STATE, PLANT),
    Wire(topics.TRUTH_PAYLOAD, PLANT),
    Wire(topics.TRUTH_ROTORS, PLANT),
    Wire(topics.TRUTH_MAGNET, PLANT),
    Wire(topics.ARM_COMMAND, ARM),
    Wire(topics.THRUST, BRIDGE),
)


def with_foreign(node: Node, foreign: Collection[str]) -> Sequence[Wire]:
    """WIRES where some nodes, by their names in `foreign`, are the user's own.

    Such a node must publish what others listen to; it listens to what it likes, as the graph that
    `node` sees tells.
    """
    if not foreign:
        return WIRES
    found = []
    for wire in WIRES:
        if wire.publisher in foreign and (wire.optional or not wire.subscribers):
            continue
        name = node.resolve_topic_name(wire.topic.name)
        hearing = {info.node_name for info in node.get_subscriptions_info_by_topic(name)}
        wanted = tuple(who for who in wire.subscribers if who not in foreign or who in hearing)
        found.append(replace(wire, subscribers=wanted))
    return found


def missing(node: Node, recorded: bool, wires: Sequence[Wire] = WIRES) -> list[str]:
    """Ends of `wires` that the graph, as `node` sees it, does not have yet, in words.

    recorded: the recorder must listen to each of these topics too.
    """
    found = []
    for wire in wires:
        name = node.resolve_topic_name(wire.topic.name)
        publishers = {info.node_name for info in node.get_publishers_info_by_topic(name)}
        listeners = {info.node_name for info in node.get_subscriptions_info_by_topic(name)}
        if wire.publisher not in publishers:
            found.append(f"{wire.publisher} to publish {name}")
        wanted = wire.listeners(recorded)
        found += [f"{who} to listen to {name}" for who in wanted if who not in listeners]
    return found


def unconnected(
    said: Connections,
    plant: Mapping[str, int],
    recorded: bool,
    wires: Sequence[Wire] = WIRES,
    foreign: Collection[str] = (),
) -> Iterator[str]:
    """Ends of `wires` that have not found all their counterparts, in words.

    said: what the other nodes say; plant: what the plant itself knows (`connections.of`); foreign:
    nodes that say nothing about it.
    """

    def count(node: str, kind: str, topic: str) -> int:
        if node == PLANT:
            return plant.get(kind + topic, 0)
        return said.readers(node, topic) if kind == READERS else said.writers(node, topic)

    for wire in wires:
        name, wanted = wire.topic.name, wire.listeners(recorded)
        silent = wire.publisher in foreign
        if not silent and count(wire.publisher, READERS, name) < len(wanted):
            yield f"{wire.publisher} to find the listeners of {name}"
        for who in wanted:
            if who not in foreign and count(who, WRITERS, name) < 1:
                yield f"{who} to find the publisher of {name}"
