"""Node: attitude law. state + reference + desired attitude of the position law → tau_q."""

from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from uam_control.control.controllers import AttitudeController
from uam_control.nodes.controller_node import ControllerNode, run_alone
from uam_control.stages.law_stages import MeasuredDelay
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import ATTITUDE_NAMES, TorqueWriter
from uam_msgs_py.messages.status import AutopilotState
from uam_msgs_py.node.namespace import frame

NAME = "attitude_controller"


class AttitudeControllerNode(ControllerNode):
    """Publishes /uam/attitude/command, empty while not flying."""

    def __init__(self):
        own = topics.ATTITUDE_COMMAND, topics.ATTITUDE_ADAPTATION
        super().__init__(NAME, AttitudeController, *own, last=topics.POSITION_COMMAND)
        self._measured = MeasuredDelay(self.controller)
        self.listen(topics.AUTOPILOT_STATE, self._on_autopilot, required=False)
        self._writer = TorqueWriter(ATTITUDE_NAMES, frame(self, topics.BODY))

    def _on_autopilot(self, message: DiagnosticArray) -> None:
        stamp, report = AutopilotState.from_message(message)
        self._measured.report(stamp, report.loop_delay)

    def _joined(self, stamp: int, *inputs: Any) -> None:
        self._measured.apply(stamp)
        super()._joined(stamp, *inputs)

    def command(self, stamp: int, tau: np.ndarray, reference: np.ndarray, flying: bool) -> bytes:
        return self._writer.fill(stamp, tau) if flying else self._writer.idle(stamp)


main = partial(run_alone, AttitudeControllerNode, NAME)  # returns the exit status
