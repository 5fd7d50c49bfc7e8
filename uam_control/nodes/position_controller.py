"""Node: position law. state + reference → tau_p and the desired attitude for this thrust."""

import numpy as np

from uam_control.control.controllers import PositionController
from uam_control.nodes.controller_node import ControllerNode
from uam_control.stages.law_stages import PositionStage
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import PositionCommandWriter, Reference
from uam_msgs_py.node.base_node import run

NAME = "position_controller"


class PositionControllerNode(ControllerNode):
    """Publishes /uam/position/command, empty while not flying."""

    def __init__(self):
        super().__init__(
            NAME,
            PositionController,
            PositionStage,
            [topics.STATE, topics.REFERENCE],
            topics.POSITION_ADAPTATION,
        )
        self._command = self.publisher(topics.POSITION_COMMAND)
        self._writer = PositionCommandWriter()

    def tick(self, stamp: int, state: np.ndarray, reference: Reference) -> None:
        tau = self.stage.update(stamp, state, reference.values, reference.flying)
        if reference.flying:
            attitude = self.stage.attitude_reference
            message = self._writer.fill(stamp, reference.values, attitude, tau)
        else:
            message = self._writer.idle(stamp)
        self._command.publish(message)


def main() -> int:
    """Run the node; return its exit status."""
    return run(PositionControllerNode, NAME)
