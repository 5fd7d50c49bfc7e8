"""Node: position law. state + reference → tau_p and the desired attitude for this thrust."""

import numpy as np

from uam_control.control.controllers import PositionController
from uam_control.nodes.controller_node import ControllerNode
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import PositionCommandWriter, Reference
from uam_msgs_py.node.base_node import run
from uam_msgs_py.node.local_delivery import LocalDelivery

NAME = "position_controller"


class PositionControllerNode(ControllerNode):
    """Publishes /uam/position/command, empty while not flying."""

    def __init__(self, delivery: LocalDelivery | None = None):
        last = topics.STATE
        super().__init__(NAME, PositionController, topics.POSITION_ADAPTATION, last, delivery)
        self._command = self.publisher(topics.POSITION_COMMAND)
        self._writer = PositionCommandWriter()

    def send(self, stamp: int, tau: np.ndarray, reference: Reference, flying: bool) -> None:
        message = self._writer.idle(stamp)
        if flying:
            attitude = self.controller.attitude_reference
            message = self._writer.fill(stamp, reference.values, attitude, tau)
        self._command.publish(message)


def main() -> int:
    """Run the node; return its exit status."""
    return run(PositionControllerNode, NAME)
