"""Who talks to whom: which nodes of a flight publish and which subscribe to each topic.

A lockstep flight is the same from the first tick on only if everyone hears it; so the plant waits
until every connection listed here exists. A test compares the list with the running nodes.
"""

from dataclasses import dataclass

from rclpy.node import Node

from uam_msgs_py import topics

ESTIMATOR, MISSION = "state_estimator", "mission"
POSITION, ATTITUDE, ARM = "position_controller", "attitude_controller", "arm_controller"
BRIDGE, PLANT, RECORDER = "mavlink_bridge", "mujoco_sim", "recorder"


@dataclass(frozen=True)
class Wire:
    """One topic from one node to several."""

    topic: topics.Topic
    publisher: str
    subscribers: tuple[str, ...]


WIRES = (
    Wire(topics.IMU, PLANT, (ESTIMATOR,)),
    Wire(topics.JOINTS, PLANT, (ESTIMATOR,)),
    Wire(topics.MOCAP, PLANT, (ESTIMATOR, BRIDGE)),
    Wire(topics.STATE, ESTIMATOR, (MISSION, POSITION, ATTITUDE, ARM, BRIDGE)),
    Wire(topics.REFERENCE, MISSION, (POSITION, ATTITUDE, ARM)),
    Wire(topics.MAGNET, MISSION, (PLANT,)),
    Wire(topics.ARMING, MISSION, (BRIDGE,)),
    Wire(topics.MISSION_STATUS, MISSION, (PLANT,)),
    Wire(topics.POSITION_COMMAND, POSITION, (ATTITUDE, ARM, BRIDGE)),
    Wire(topics.ATTITUDE_COMMAND, ATTITUDE, (BRIDGE,)),
    Wire(topics.ARM_EFFORT, ARM, (PLANT,)),
    Wire(topics.SETPOINT, BRIDGE, (PLANT,)),
    Wire(topics.AUTOPILOT_STATE, BRIDGE, (MISSION,)),
)
NODES = (ESTIMATOR, MISSION, POSITION, ATTITUDE, ARM, BRIDGE, PLANT)


def missing(node: Node, recorded: bool) -> list[str]:
    """Connections of WIRES that the graph, as `node` sees it, does not have yet, in words.

    recorded: the recorder must listen to each of these topics too.
    """
    found = []
    for wire in WIRES:
        name = node.resolve_topic_name(wire.topic.name)
        publishers = {info.node_name for info in node.get_publishers_info_by_topic(name)}
        listeners = {info.node_name for info in node.get_subscriptions_info_by_topic(name)}
        if wire.publisher not in publishers:
            found.append(f"{wire.publisher} to publish {name}")
        wanted = (*wire.subscribers, RECORDER) if recorded else wire.subscribers
        found += [f"{who} to listen to {name}" for who in wanted if who not in listeners]
    return found


def absent_nodes(waiting: list[str]) -> list[str]:
    """The nodes that `missing` names, in order, once each."""
    return list(dict.fromkeys(text.split(maxsplit=1)[0] for text in waiting))
