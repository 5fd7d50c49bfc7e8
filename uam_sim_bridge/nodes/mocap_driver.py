"""Node: a motion capture system → /vrpn_mocap/uam/pose and /vrpn_mocap/payload/pose.

The node waits for packets in place of messages: it has no inputs, and a pose must not wait for a
timer. A body that is lost leaves its topic silent; the diagnostics say why.
"""

import time

from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import ParameterError
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import PoseWriter
from uam_msgs_py.messages.status import ERROR, OK, WARN
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.node_parameters import NodeParameters, refuse_unknown
from uam_sim_bridge.devices.mocap import calibration
from uam_sim_bridge.devices.mocap.driver import Level, MocapDriver
from uam_sim_bridge.devices.mocap.frame import MocapError
from uam_sim_bridge.devices.mocap.mocap_parameters import MocapParameters, open_source
from uam_sim_bridge.nodes.late_device import LateDevice

NAME = "mocap_driver"
WAIT = 0.02  # [s] for a packet, then services and timers are served
SAY_PERIOD = 0.1  # [s]
LEVELS = {Level.OK: OK, Level.WARN: WARN, Level.ERROR: ERROR}


class MocapDriverNode(UamNode):
    """Publishes the poses with the stamps of their exposures, in the system's clock."""

    wake_up = 0.0  # `settle` waits

    def __init__(self) -> None:
        super().__init__(NAME)
        parameters = NodeParameters(self, MocapParameters, read_only=True).current
        try:
            calibrated = calibration.load(parameters.calibration)
        except ConfigurationError as error:
            raise ParameterError(f"calibration: {error}") from None

        def opened() -> MocapDriver:
            return MocapDriver(parameters, calibrated, open_source(parameters))

        self._system = LateDevice(self, opened, (MocapError,))
        refuse_unknown(self)  # before the system is asked
        self._system.begin()
        if not self._system.waits:
            self._system.device.check_names()
        self._writer = PoseWriter()
        self._vehicle = self.publisher(topics.MOCAP)
        self._payload = self.publisher(topics.PAYLOAD) if parameters.payload else None
        self._said = ""
        self.every(SAY_PERIOD, self._say)

    def settle(self) -> None:
        """Publish the poses that arrive within WAIT."""
        driver = self._system.attempt()
        if driver is None:
            time.sleep(WAIT)
            return
        begun = time.perf_counter()
        for pose in driver.receive(WAIT):
            publisher = self._payload if pose.payload else self._vehicle
            publisher.publish(self._writer.fill(pose.stamp, pose.position, pose.quaternion))
            if not pose.payload:
                self.done_tick(pose.stamp, begun)

    def _say(self) -> None:
        """Log a change of the health once."""
        if self._system.device is None:  # logged by the attempt
            return
        level, text = self._system.device.health()
        if text == self._said:
            return
        self._said = text
        if level is Level.OK:
            self.get_logger().info(text)
        elif level is Level.WARN:
            self.get_logger().warning(text)
        else:
            self.get_logger().error(text)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        driver = self._system.device
        if driver is None:
            return ERROR, self._system.problem, {}
        level, text = driver.health()
        return LEVELS[level], text, driver.values()

    def destroy_node(self) -> None:
        system = getattr(self, "_system", None)
        if system is not None and system.device is not None:
            system.device.close()
        super().destroy_node()


def main() -> int:
    return run(MocapDriverNode, NAME)
