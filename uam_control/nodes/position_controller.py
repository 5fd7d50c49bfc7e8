"""Node: position law. state + reference → tau_p and the desired attitude for this thrust."""

from functools import partial

import numpy as np

from uam_control.control.controllers import PositionController
from uam_control.nodes.controller_node import ControllerNode, run_alone
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import PositionCommandWriter

NAME = "position_controller"


class PositionControllerNode(ControllerNode):
    """Publishes /uam/position/command, empty while not flying."""

    def __init__(self):
        own = topics.POSITION_COMMAND, topics.POSITION_ADAPTATION
        super().__init__(NAME, PositionController, *own, last=topics.STATE)
        self._writer = PositionCommandWriter()

    def command(self, stamp: int, tau: np.ndarray, reference: np.ndarray, flying: bool) -> bytes:
        if not flying:
            return self._writer.idle(stamp)
        return self._writer.fill(stamp, reference, self.controller.attitude_reference, tau)


main = partial(run_alone, PositionControllerNode, NAME)  # returns the exit status
