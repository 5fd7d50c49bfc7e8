"""Node: arm law. state + reference + desired attitude of the position law → joint efforts
or goal positions."""

from functools import partial

import numpy as np

from uam_control.control.controllers import ArmController
from uam_control.control.hand_steering import IDLE, TEXTS
from uam_control.control.output_limits import ArmLimits
from uam_control.coordinates import ARM
from uam_control.nodes.controller_node import ControllerNode, run_alone
from uam_control.stages.law_stages import HandStage
from uam_control.vehicle import POSITION_SERVO
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import TorqueWriter
from uam_msgs_py.messages.convert import JointCommandWriter
from uam_msgs_py.messages.status import WARN

NAME = "arm_controller"


class ArmControllerNode(ControllerNode):
    """Publishes the servos' commands, one message per state, on the ground as well."""

    def __init__(self):
        own = topics.ARM_COMMAND, topics.ARM_ADAPTATION
        super().__init__(NAME, ArmController, *own, last=topics.POSITION_COMMAND)
        names = list(self.vehicle.coordinates[ARM])
        parameters, period = self.parameter_set.current, self.vehicle.control_period
        self.hand = HandStage(parameters, period, len(names), self.vehicle)
        self.parameter_set.apply = self._configure
        to_goals = self.parameter_set.current.setpoint == POSITION_SERVO
        outlets = [self.publisher(topic) for topic in (topics.ARM_EFFORT, topics.ARM_GOALS)]
        self._servos = outlets[to_goals]
        self._servo_writer = JointCommandWriter(len(names))
        self._writer = TorqueWriter(names)

    def _configure(self, parameters: ArmLimits) -> None:
        self.controller.set_parameters(parameters)
        self.hand.configure(parameters)

    def reference_of(self, state: np.ndarray, reference: np.ndarray, flying: bool) -> np.ndarray:
        return self.hand.update(state, reference, flying, self.controller.saturated)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        level, summary, values = super().diagnose()
        fades, on = self.hand.fades, self.parameter_set.current.hand_bandwidth > 0.0
        if fades and fades != TEXTS[IDLE]:
            level, summary = max(level, WARN), f"the hand's stabilisation fades out: {fades}"
        if stuck := self.controller.stuck:
            joints = ", ".join(map(str, stuck))
            level, summary = max(level, WARN), f"no feedback of stuck joints: {joints}"
        told = (f"fades out: {fades}" if fades else "acts") if on else "off"
        return level, summary, values | {"hand's stabilisation": told}

    def answer(self) -> None:
        self._servos.publish(self._servo_writer.fill(self.controller.command))

    def command(self, stamp: int, tau: np.ndarray, reference: np.ndarray, flying: bool) -> bytes:
        return self._writer.fill(stamp, tau)


main = partial(run_alone, ArmControllerNode, NAME)  # returns the exit status
