"""The poses that a node reads: of a motion capture, or of an odometry without its jumps."""

from typing import Any

import numpy as np
from rclpy.node import Node

from uam_control.estimation.pose_anchor import ODOMETRY, RETURN, PoseAnchor, PoseSourceParameters
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import read_pose
from uam_msgs_py.messages.navigation import read_odometry
from uam_msgs_py.node.namespace import frame
from uam_msgs_py.node.node_parameters import NodeParameters


class PoseSource:
    """Reads poses by the node's parameter `pose_source`."""

    def __init__(self, node: Node) -> None:
        chosen = NodeParameters(node, PoseSourceParameters, read_only=True).current.pose_source
        self.odometry = chosen == ODOMETRY  # whether the poses are of an odometry
        self.topic = topics.ODOMETRY_IN if self.odometry else topics.MOCAP
        self._body = frame(node, topics.BODY)
        self._anchor, self._told = PoseAnchor(), 0

    def read(self, message: Any) -> tuple[int, np.ndarray, np.ndarray]:
        """Return (stamp [ns], position (3,) [m], quaternion (4,) [w x y z]); raise BadMessage."""
        if not self.odometry:
            return read_pose(message)
        stamp, *pose = read_odometry(message, self._body)
        return stamp, *self._anchor(stamp / SECOND, *pose)

    def news(self) -> str:
        """Return a line about the jumps since the last call, "" without one."""
        fresh, self._told = self._anchor.jumps - self._told, self._anchor.jumps
        if not fresh:
            return ""
        times = "" if fresh == 1 else f" {fresh} times, the last time"
        distance, turn = self._anchor.distance, self._anchor.turn
        how = f"by {distance:.2f} m and {turn:.2f} rad"
        return f"odometry jumped{times} {how}: taken out, given back at {RETURN:g} m/s"
