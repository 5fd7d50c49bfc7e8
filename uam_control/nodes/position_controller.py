"""Node: position law. state + reference → tau_p and the attitude that points the thrust so."""

import numpy as np

from uam_control.control.controllers import PositionController
from uam_control.nodes.controller_node import ControllerNode
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
            [topics.STATE, topics.REFERENCE],
            topics.POSITION_ADAPTATION,
        )
        self._command = self.publisher(topics.POSITION_COMMAND)
        self._writer = PositionCommandWriter()

    def tick(self, stamp: int, dt: float, state: np.ndarray, reference: Reference) -> None:
        tau = self.controller.update(state, reference.values, reference.flying, dt)
        if reference.flying:
            attitude = self.controller.attitude_reference
            message = self._writer.fill(stamp, reference.values, attitude, tau)
        else:
            message = self._writer.idle(stamp)
        self._command.publish(message)

    def evaluate(
        self,
        controller: PositionController,
        dt: float,
        state: np.ndarray,
        reference: np.ndarray,
        attitude: np.ndarray,
        flying: bool,
    ) -> np.ndarray:
        return controller.update(state, reference, flying, dt)


def main() -> int:
    """Run the node; return its exit status."""
    return run(PositionControllerNode, NAME)
