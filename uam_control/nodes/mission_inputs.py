"""Subscriptions of the mission node for the supervisor's limits, and its services in flight.

Messages stay serialized until `SupervisorInputs` reads them.

| service | type | does |
|---|---|---|
| `~/start` | std_srvs/Trigger | arm and take off, if the pre-arm report is green |
| `~/hold` | std_srvs/Trigger | stop on the path and hold the position |
| `~/resume` | std_srvs/Trigger | continue on the path after a hold; regain a released vehicle |
| `~/land` | std_srvs/Trigger | stop on a fast path, descend vertically and disarm |
| `~/disarm` | std_srvs/Trigger | motors off: on the ground, or in failsafe |
| `~/magnet` | std_srvs/SetBool | on or off until the scenario switches it next |

The response contains the action of the next tick, or the reason why the command is refused.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import Temperature
from std_srvs.srv import SetBool, Trigger

from uam_control.mission import Mission
from uam_control.nodes.pose_source import PoseSource
from uam_control.stages.supervisor_inputs import SupervisorInputs
from uam_control.stamps import SECOND
from uam_control.supervision import OperatorCommand
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import (
    GRIPPER,
    read_efforts,
    read_grip,
    read_imu,
    read_pose,
    read_values,
)
from uam_msgs_py.messages.layouts import BadMessage, stamp_of
from uam_msgs_py.node.answering import offer
from uam_msgs_py.node.base_node import UamNode

GAINS = (
    (topics.POSITION_ADAPTATION, "position"),
    (topics.ATTITUDE_ADAPTATION, "attitude"),
    (topics.ARM_ADAPTATION, "arm"),
)
COMMANDS = {
    command.name.lower(): command
    for command in OperatorCommand
    if command is not OperatorCommand.GOAL  # comes with a pose or trajectory, see planner_inputs
}
START, MAGNET = "start", "magnet"


class MissionInputs:
    """Subscriptions that feed the supervisor's inputs of the mission's stage."""

    def __init__(self, node: UamNode, supervisor: SupervisorInputs, joints: Sequence[str]):
        """joints: their names."""
        self._names = list(joints)
        self._node = node
        self._supervisor, self._inputs = supervisor, supervisor.inputs
        self.poses = PoseSource(node)
        read = self.poses.read  # the supervisor refuses a pose that the estimator cannot use
        self._keep(self.poses.topic, lambda message: supervisor.mocap(*read(message)))
        self._keep(topics.PAYLOAD, lambda data: supervisor.payload(*read_pose(data)))
        self._keep(topics.THRUST, self._on_thrust, stamp_of)
        self._keep(topics.IMU_BIAS, self._on_imu_bias, stamp_of)
        self._keep(topics.JOINTS, self._on_joints)
        self._keep(topics.AUTOPILOT_BATTERY, lambda m: self._inputs.battery(m.percentage))
        node.listen(topics.ARM_TEMPERATURE, self._on_temperature, required=False)
        for topic, subsystem in GAINS:
            self._keep(topic, partial(self._on_gains, subsystem), stamp_of)

    def _keep(
        self,
        topic: topics.Topic,
        read: Callable[[Any], None],
        answers: Callable[[Any], int] = lambda message: -1,
    ) -> None:
        """Keep the newest message of a topic until it is read; see `SupervisorInputs.keep`."""
        name = topic.name

        def guarded(message: Any) -> None:
            self._node.door.accepts(inlet, read, message)

        def handle(message: Any) -> None:
            self._supervisor.keep(name, guarded, (message,), answers(message))

        inlet = self._node.listen(topic, handle, required=False)

    def _on_thrust(self, data: bytes) -> None:
        _, _, lift = read_values(data, "effort")
        _, _, throttle = read_values(data, "velocity")
        if len(lift):
            self._inputs.lift(float(lift[0]), float(throttle[0]))

    def _on_imu_bias(self, data: bytes) -> None:
        stamp, _, accelerometer = read_imu(data)
        self._inputs.accelerometer_bias(stamp / SECOND, accelerometer)

    def _on_joints(self, data: bytes) -> None:
        stamp, effort = read_efforts(data, self._names)
        self._inputs.joints(stamp / SECOND, effort)
        if (grip := read_grip(data)) is not None:
            self._inputs.grip(grip)

    def _on_temperature(self, message: Temperature) -> None:
        joint = message.header.frame_id
        if joint not in (*self._names, GRIPPER):
            raise BadMessage(f"frame_id {joint!r} is no joint; there are: {', '.join(self._names)}")
        self._inputs.temperature(joint, message.temperature)

    def _on_gains(self, subsystem: str, data: bytes) -> None:
        stamp, names, values = read_values(data, "position")
        self._inputs.gains(stamp / SECOND, subsystem, names, values)


def offer_commands(node: Node, mission: Mission) -> None:
    """Create the services of `mission` in `node`; they run between two ticks."""
    for name, command in COMMANDS.items():
        offer(node, Trigger, f"~/{name}", partial(mission.request, command))
    offer(node, Trigger, f"~/{START}", mission.start)
    offer(node, SetBool, f"~/{MAGNET}", mission.switch_magnet)
