"""Who talks to whom: which nodes of a flight publish and which subscribe to each topic.

A lockstep flight is the same from the first tick on only if everyone hears it. So the plant waits
until every connection listed here exists, as the nodes at both of its ends say. A test compares the
list with the running nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from rclpy.node import Node

from uam_msgs_py import topics
from uam_msgs_py.connections import READERS, WRITERS, Connections

ESTIMATOR, MISSION = "state_estimator", "mission"
POSITION, ATTITUDE, ARM = "position_controller", "attitude_controller", "arm_controller"
BRIDGE, PLANT, RECORDER = "mavlink_bridge", "mujoco_sim", "recorder"


@dataclass(frozen=True)
class Wire:
    """One topic from one node to several; the recorder comes on top of them."""

    topic: topics.Topic
    publisher: str
    subscribers: tuple[str, ...] = ()

    def listeners(self, recorded: bool) -> tuple[str, ...]:
        """The subscribers, the recorder among them if it is there."""
        return (*self.subscribers, RECORDER) if recorded else self.subscribers


WIRES = (
    Wire(topics.IMU, PLANT, (ESTIMATOR,)),
    Wire(topics.JOINTS, PLANT, (ESTIMATOR,)),
    Wire(topics.MOCAP, PLANT, (ESTIMATOR, BRIDGE)),
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
    # only recorded
    Wire(topics.CLOCK, PLANT),
    Wire(topics.TRUTH_STATE, PLANT),
    Wire(topics.TRUTH_PAYLOAD, PLANT),
    Wire(topics.TRUTH_ROTORS, PLANT),
    Wire(topics.TRUTH_MAGNET, PLANT),
    Wire(topics.AUTOPILOT_BATTERY, BRIDGE),
    Wire(topics.ARM_COMMAND, ARM),
    Wire(topics.THRUST, BRIDGE),
    Wire(topics.POSITION_ADAPTATION, POSITION),
    Wire(topics.ATTITUDE_ADAPTATION, ATTITUDE),
    Wire(topics.ARM_ADAPTATION, ARM),
)


def missing(node: Node, recorded: bool) -> list[str]:
    """Ends of WIRES that the graph, as `node` sees it, does not have yet, in words.

    recorded: the recorder must listen to each of these topics too.
    """
    found = []
    for wire in WIRES:
        name = node.resolve_topic_name(wire.topic.name)
        publishers = {info.node_name for info in node.get_publishers_info_by_topic(name)}
        listeners = {info.node_name for info in node.get_subscriptions_info_by_topic(name)}
        if wire.publisher not in publishers:
            found.append(f"{wire.publisher} to publish {name}")
        wanted = wire.listeners(recorded)
        found += [f"{who} to listen to {name}" for who in wanted if who not in listeners]
    return found


def unconnected(said: Connections, plant: Mapping[str, int], recorded: bool) -> Iterator[str]:
    """Ends of WIRES that have not found all their counterparts, in words.

    said: what the other nodes say; plant: what the plant itself knows (`connections.of`).
    """

    def count(node: str, kind: str, topic: str) -> int:
        if node == PLANT:
            return plant.get(kind + topic, 0)
        return said.readers(node, topic) if kind == READERS else said.writers(node, topic)

    for wire in WIRES:
        name, wanted = wire.topic.name, wire.listeners(recorded)
        if count(wire.publisher, READERS, name) < len(wanted):
            yield f"{wire.publisher} to find the listeners of {name}"
        for who in wanted:
            if count(who, WRITERS, name) < 1:
                yield f"{who} to find the publisher of {name}"
