"""A process that publishes on every topic of the control loop, one node per topic.

    python tests/impostor.py <namespace>

ROS_DOMAIN_ID and the transport come from the environment. Each node `impostor_<n>` sends messages
that would tumble the vehicle, 20 times a second, until the process is ended.
"""

import sys
import time

import numpy as np
import rclpy
from rclpy.node import Node
from std_msgs.msg import Bool

from uam_control.coordinates import coordinates
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import (
    SWITCH,
    ImuWriter,
    JointCommandWriter,
    JointStateWriter,
    PoseWriter,
    SetpointWriter,
    TrajectoryWriter,
)

LOOP = (
    *(topics.IMU, topics.JOINTS, topics.MOCAP, topics.STATE, topics.REFERENCE),
    *(topics.POSITION_COMMAND, topics.ATTITUDE_COMMAND, topics.ARM_COMMAND, topics.ARM_EFFORT),
    *(topics.SETPOINT, topics.MAGNET, topics.ARMING),
)
PERIOD = 0.05  # s
JOINTS = ["alpha_1", "alpha_2"]


def name_of(topic: topics.Topic) -> str:
    """The impostor's node name on a topic."""
    return f"impostor_{LOOP.index(topic)}"


def nonsense(topic: topics.Topic):
    """Return a function of the stamp [ns] that makes a message the stack can read."""
    if topic.type is Bool:
        return lambda _: SWITCH[True] if topic is topics.MAGNET else SWITCH[False]
    if topic is topics.IMU:
        writer = ImuWriter()
        return lambda stamp: writer.fill(stamp, np.full(3, 3.0), np.zeros(3))
    if topic is topics.MOCAP:
        writer = PoseWriter()
        return lambda stamp: writer.fill(stamp, np.full(3, 5.0), np.array([1.0, 0.0, 0.0, 0.0]))
    if topic is topics.SETPOINT:
        writer = SetpointWriter()
        return lambda stamp: writer.fill(stamp, np.full(3, 2.0), 1.0)
    if topic is topics.ARM_EFFORT:
        writer = JointCommandWriter(2)
        return lambda _: writer.fill(np.full(2, 2.0))
    if topic is topics.JOINTS:
        writer = JointStateWriter(list(reversed(JOINTS)))
        writer.position[:] = 1.0
    else:
        writer = TrajectoryWriter(coordinates(2))
        writer.fill(0, np.full((3, 8), 4.0))
    return writer.stamped


def main() -> None:
    """Publish until the process is ended, with stamps ahead of the flight's."""
    rclpy.init(args=[])
    namespace = sys.argv[1] if len(sys.argv) > 1 else ""
    ends = []
    for topic in LOOP:
        node = Node(name_of(topic), namespace=namespace, start_parameter_services=False)
        ends.append((node.create_publisher(topic.type, topic.name, topic.qos), nonsense(topic)))
    begun = time.monotonic()
    while True:
        ticks = round((time.monotonic() - begun) / 0.004)
        for publisher, message in ends:
            publisher.publish(message(4_000_000 * ticks))
        time.sleep(PERIOD)


if __name__ == "__main__":
    main()
