"""Node: teleop. joy → twist of the hand, gripper command, hold; see stages/gamepad.py."""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial

from geometry_msgs.msg import TwistStamped
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from uam_control.settings.parameter_set import ParameterError, Text
from uam_control.stages.gamepad import DEFAULT, Gamepad, Mapping, MappingError
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.node_names import MISSION
from uam_msgs_py.messages.ros_time import set_stamp
from uam_msgs_py.messages.status import OK, WARN
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.namespace import frame
from uam_msgs_py.node.node_parameters import declared_text, plain, refuse_unknown

NAME = "teleop"
HOLD = "mission/hold"
LIMITS = ["jog_speed", "jog_turn_rate"]  # of the mission
EVERY = 1.0  # [s] they are asked for: they may be set in flight


class Teleop:
    """Sends what a gamepad asks for through a node. `sent`: number of the twists."""

    def __init__(self, node: Node, mapping: Mapping, say: Callable[[str], object]) -> None:
        """say: called with a text for the person."""
        self._node, self._gamepad, self._say = node, Gamepad(mapping), say
        self._mapping, self.sent = mapping, 0
        tool = frame(node, topics.TOOL)
        self._frame = tool if mapping.frame == topics.TOOL else topics.WORLD
        self._twist = topics.END_EFFECTOR_TWIST.outlet(node)
        self._gripper = topics.GRIPPER_COMMAND.outlet(node)
        self._hold = node.create_client(Trigger, HOLD)
        self._limits = node.create_client(GetParameters, f"{MISSION}/get_parameters")
        self._jog: tuple[float, float] | None = None  # [m/s], [rad/s] LIMITS
        self._heard = 0.0  # [s] time.monotonic() of the newest axes
        self._asked = -math.inf  # [s] the same of the newest request for LIMITS

    def hear(self, axes: Sequence[float], buttons: Sequence[int]) -> None:
        """Take axes and buttons; a button acts at once. Raises ValueError, and stops then."""
        hold, gripper = self._gamepad.read(axes, buttons)
        self._heard = time.monotonic()
        if hold:
            self._call_hold()
        if gripper is not None:
            self._gripper.publish(Float64(data=gripper))
            self._say(f"gripper {gripper:g}")

    def tick(self) -> None:
        """Send the twist; call it `rate` times a second. Nothing without the mission's limits."""
        now = time.monotonic()
        if now - self._asked > EVERY and self._limits.service_is_ready():
            self._asked = now
            future = self._limits.call_async(GetParameters.Request(names=LIMITS))
            future.add_done_callback(self._know)
        if now - self._heard > self._mapping.silent_after:
            self._gamepad.silence()
        if self._jog is None or (twist := self._gamepad.twist(self._jog)) is None:
            return
        message = TwistStamped()
        message.header.frame_id = self._frame
        set_stamp(message.header.stamp, self._node.get_clock().now().nanoseconds)
        linear, angular = message.twist.linear, message.twist.angular
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = twist.tolist()
        self._twist.publish(message)
        self.sent += 1

    def _know(self, done: Future) -> None:
        values = [plain(one) for one in done.result().values]
        if len(values) == len(LIMITS) and None not in values:
            self._jog = tuple(values)

    @property
    def limits(self) -> str:
        """Say what the end of an axis asks for."""
        return (
            "not known yet" if self._jog is None else "{:.3g} m/s, {:.3g} rad/s".format(*self._jog)
        )

    def _call_hold(self) -> None:
        if not self._hold.service_is_ready():
            self._say(f"hold: no service {self._hold.srv_name}")
            return
        future = self._hold.call_async(Trigger.Request())
        future.add_done_callback(lambda done: self._say(f"hold: {done.result().message}"))


class TeleopNode(UamNode):
    """Listens to `joy`."""

    def __init__(self) -> None:
        super().__init__(NAME)
        about = Text("axes, buttons and keys", "name of a file in config/teleop, or a file")
        given = declared_text(self, "mapping", DEFAULT, about)
        try:
            mapping = Mapping.read(given)
        except MappingError as error:
            raise ParameterError(f"mapping: {error}") from None
        refuse_unknown(self)
        self._teleop = Teleop(self, mapping, self.get_logger().info)
        self._problem = ""
        self.listen(topics.JOY, self._on_joy)
        self.every(1.0 / mapping.rate, self._teleop.tick)

    def _on_joy(self, message: Joy) -> None:
        begun = time.perf_counter()
        try:
            self._teleop.hear(message.axes, message.buttons)
        except ValueError as error:
            self._problem = f"joy: {error}"
            raise BadMessage(str(error)) from None
        self._problem = ""
        stamp = message.header.stamp
        self.done_tick(stamp.sec * SECOND + stamp.nanosec, begun)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        level, summary = (WARN, self._problem) if self._problem else (OK, "running")
        return level, summary, {"twists sent": self._teleop.sent, "full stick": self._teleop.limits}


main = partial(run, TeleopNode, NAME)  # returns the exit status
