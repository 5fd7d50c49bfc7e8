"""Node: arm law. state + reference + desired attitude of the position law → joint efforts
or goal positions."""

import numpy as np

from uam_control.control.controllers import ArmController
from uam_control.control.output_limits import ArmLimits
from uam_control.coordinates import ARM
from uam_control.nodes.controller_node import ControllerNode
from uam_control.stages.hand_stage import HandStage
from uam_control.vehicle import POSITION_SERVO
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import Reference, TorqueWriter
from uam_msgs_py.messages.convert import JointCommandWriter
from uam_msgs_py.node.base_node import run
from uam_msgs_py.node.local_delivery import LocalDelivery

NAME = "arm_controller"


class ArmControllerNode(ControllerNode):
    """Publishes the servos' commands, one message per state, on the ground as well."""

    def __init__(self, delivery: LocalDelivery | None = None):
        last = topics.POSITION_COMMAND
        super().__init__(NAME, ArmController, topics.ARM_ADAPTATION, last, delivery)
        names = list(self.vehicle.coordinates[ARM])
        parameters, period = self.parameter_set.current, self.vehicle.control_period
        self._hand = HandStage(parameters, period, len(names), self.vehicle)
        self.parameter_set.apply = self._configure
        to_goals = self.parameter_set.current.setpoint == POSITION_SERVO
        outlets = [self.publisher(topic) for topic in (topics.ARM_EFFORT, topics.ARM_GOALS)]
        self._servos = outlets[to_goals]
        self._command = self.publisher(topics.ARM_COMMAND)
        self._servo_writer = JointCommandWriter(len(names))
        self._writer = TorqueWriter(names)

    def _configure(self, parameters: ArmLimits) -> None:
        self.controller.set_parameters(parameters)
        self._hand.configure(parameters)

    def reference_of(self, state: np.ndarray, reference: np.ndarray, flying: bool) -> np.ndarray:
        return self._hand.update(state, reference, flying, self.controller.saturated)

    def send(self, stamp: int, tau: np.ndarray, reference: Reference, flying: bool) -> None:
        self._servos.publish(self._servo_writer.fill(self.controller.command))
        self._command.publish(self._writer.fill(stamp, tau))


def main() -> int:
    """Run the node; return its exit status."""
    return run(ArmControllerNode, NAME)
