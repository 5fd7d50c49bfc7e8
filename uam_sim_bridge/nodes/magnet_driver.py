"""Node: /uam/magnet → a GPIO line, with its state on /uam/magnet/state; the bridge has both, too.

For a magnet on an output of the autopilot see the parameter `magnet` of `mavlink_bridge`.
"""

import time
from collections.abc import Callable

from std_msgs.msg import Bool

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import ERROR, OK, WARN
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.node_parameters import NodeParameters, refuse_unknown
from uam_sim_bridge.devices.magnet.lines import (
    LineParameters,
    MagnetDriver,
    MagnetError,
    MagnetSwitching,
    SwitchingParameters,
    open_line,
)
from uam_sim_bridge.nodes.late_device import LateDevice

NAME = "magnet_driver"
STATE_PERIOD = 1.0  # [s] between two messages of an unchanged state
READ_PERIOD = 0.1  # [s] between two looks at the line without a command


class MagnetTopics:
    """`switching`: the desired state by the commands so far."""

    def __init__(
        self, node: UamNode, parameters: SwitchingParameters, now: Callable[[], float]
    ) -> None:
        """now: the time [s] at which a command arrives."""
        self.switching = MagnetSwitching(parameters)
        self.subscription = node.listen(
            topics.MAGNET, lambda message: self.switching.command(now(), message.data)
        )
        self._publisher = node.publisher(topics.MAGNET_STATE)
        self._published: bool | None = None
        self._due = 0.0

    def publish(self, time: float, state: bool | None) -> None:
        """Publish the state when it changes, and once per STATE_PERIOD; None: it is unknown."""
        if state is None:
            self._published = None
        elif state is not self._published or time >= self._due:
            self._published, self._due = state, time + STATE_PERIOD
            self._publisher.publish(Bool(data=state))

    def problem(self, time: float) -> str:
        """Return one line if commands are lost, else ""."""
        if not self.switching.stale(time):
            return ""
        word = "on" if self.switching.desired(time) else "off"
        return f"magnet {word}: commands are lost"


class MagnetDriverNode(UamNode):
    """Switches the line at each command, and reads it back."""

    wake_up = READ_PERIOD

    def __init__(self) -> None:
        super().__init__(NAME)
        line = NodeParameters(self, LineParameters, read_only=True).current
        switching = NodeParameters(self, SwitchingParameters, read_only=True).current
        self._topics = MagnetTopics(self, switching, time.monotonic)
        self._line = LateDevice(self, lambda: MagnetDriver(open_line(line)), (MagnetError,))
        refuse_unknown(self)  # before the line is switched
        self._line.begin()
        self._chip = line.chip
        self._said = ""

    def settle(self) -> None:
        """Switch as commanded; called after each command and each READ_PERIOD."""
        begun, now = time.perf_counter(), time.monotonic()
        driver = self._line.attempt()
        if driver is None:
            return
        before = driver.switched
        driver.update(self._topics.switching.desired(now))
        self._topics.publish(now, driver.state)
        if driver.switched != before:
            self.done_tick(self.get_clock().now().nanoseconds, begun)
        problem = driver.problem or self._topics.problem(now)
        if problem and problem != self._said:
            self.get_logger().error(problem)
        self._said = problem

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        driver, now = self._line.device, time.monotonic()
        if driver is None:
            return ERROR, self._line.problem, {"line": self._chip}
        values = {"line": self._chip, "state": driver.state, "switched": driver.switched}
        if driver.problem:
            return ERROR, driver.problem, values
        if lost := self._topics.problem(now):
            return WARN, lost, values
        return OK, "magnet on" if driver.state else "magnet off", values

    def destroy_node(self) -> None:
        """Leave the magnet as `magnet_at_exit` says, then close the line and the node."""
        line = getattr(self, "_line", None)
        if line is not None and line.device is not None:
            line.device.end(self._topics.switching.at_exit())
        super().destroy_node()


def main() -> int:
    return run(MagnetDriverNode, NAME)
