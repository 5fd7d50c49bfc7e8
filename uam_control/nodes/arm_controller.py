"""Node: arm law. state + reference + desired attitude of the position law → joint efforts."""

import numpy as np

from uam_control.control.controllers import ArmController
from uam_control.coordinates import ARM
from uam_control.nodes.controller_node import ControllerNode
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import Reference, TorqueWriter
from uam_msgs_py.messages.convert import EffortWriter
from uam_msgs_py.node.base_node import run

NAME = "arm_controller"


class ArmControllerNode(ControllerNode):
    """Publishes joint efforts, one message per state, on the ground as well."""

    def __init__(self):
        super().__init__(NAME, ArmController, topics.ARM_ADAPTATION, topics.POSITION_COMMAND)
        names = list(self.vehicle.coordinates[ARM])
        self._effort = self.publisher(topics.ARM_EFFORT)
        self._command = self.publisher(topics.ARM_COMMAND)
        self._effort_writer = EffortWriter(len(names))
        self._writer = TorqueWriter(names)

    def send(self, stamp: int, tau: np.ndarray, reference: Reference, flying: bool) -> None:
        self._effort.publish(self._effort_writer.fill(tau))
        self._command.publish(self._writer.fill(stamp, tau))


def main() -> int:
    """Run the node; return its exit status."""
    return run(ArmControllerNode, NAME)
