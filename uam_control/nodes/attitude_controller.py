"""Node: attitude law. state + reference + desired attitude of the position law → tau_q."""

import numpy as np

from uam_control.control.controllers import AttitudeController
from uam_control.nodes.controller_node import ControllerNode
from uam_control.stages.law_stages import TorqueStage
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import ATTITUDE_NAMES, PositionCommand, Reference, TorqueWriter
from uam_msgs_py.node.base_node import run

NAME = "attitude_controller"


class AttitudeControllerNode(ControllerNode):
    """Publishes /uam/attitude/command, empty while not flying."""

    def __init__(self):
        super().__init__(
            NAME,
            AttitudeController,
            TorqueStage,
            [topics.STATE, topics.REFERENCE, topics.POSITION_COMMAND],
            topics.ATTITUDE_ADAPTATION,
        )
        self._command = self.publisher(topics.ATTITUDE_COMMAND)
        self._writer = TorqueWriter(ATTITUDE_NAMES)

    def tick(
        self,
        stamp: int,
        state: np.ndarray,
        reference: Reference,
        position: PositionCommand,
    ) -> None:
        flying = reference.flying and position.flying
        tau = self.stage.update(stamp, state, reference.values, position.attitude, flying)
        self._command.publish(self._writer.fill(stamp, tau) if flying else self._writer.idle(stamp))


def main() -> int:
    """Run the node; return its exit status."""
    return run(AttitudeControllerNode, NAME)
