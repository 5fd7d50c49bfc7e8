"""Sensors whose driver is another's on the vehicle: nodes of a rehearsal that publish them.

With `imu: topic` the companion's IMU, with `mocap: topic` the poses, each after its latency.
"""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import ImuWriter, PoseWriter
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.namespace import frame
from uam_sim_bridge.plant.sensors import Delay

IMU_DRIVER, POSE_DRIVER = "imu_driver", "pose_driver"


class DriverTopic:
    """A node of its own that publishes one topic."""

    def __init__(self, node: Node, name: str, topic: Topic, writer: Any, latency: int) -> None:
        """node: in whose namespace; writer: fills the message; latency [ticks]."""
        self._own = Node(name, namespace=node.get_namespace())
        self._publisher = self._own.create_publisher(topic.type, topic.name, topic.qos)
        self._writer, self._delay = writer, Delay(latency)

    def publish(self, tick: int, sample: tuple | None, shift: float, plugged: bool = True) -> None:
        """Publish the sample that is due at `tick`; sample: a new one, time [s] of the plant first.

        shift [s]: from the plant's time to the system's; plugged: whether the sensor is there.
        """
        due = self._delay(tick, sample)
        if due is not None and plugged:
            time, *values = due
            self._publisher.publish(self._writer.fill(round((time + shift) * SECOND), *values))

    def close(self) -> None:
        """Destroy the node."""
        self._own.destroy_node()


def imu_driver(node: Node, latency: int) -> DriverTopic:
    """Return the driver of the companion's IMU; latency [ticks]."""
    writer = ImuWriter(frame(node, topics.BODY))
    return DriverTopic(node, IMU_DRIVER, topics.IMU, writer, latency)


def pose_driver(node: Node, latency: int) -> DriverTopic:
    """Return another's driver of the motion capture; latency [ticks] from exposure."""
    return DriverTopic(node, POSE_DRIVER, topics.MOCAP, PoseWriter(), latency)
