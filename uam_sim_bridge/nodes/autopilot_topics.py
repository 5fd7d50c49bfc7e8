"""Reports of the autopilot: /uam/autopilot/state, /uam/autopilot/battery, log lines."""

import math
import time

from sensor_msgs.msg import BatteryState

from uam_control.stages.autopilot_port import AutopilotReport
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import ImuWriter
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.parameter_comparison import ParameterComparison, ParameterDifference
from uam_msgs_py.messages.ros_time import set_stamp
from uam_msgs_py.messages.status import AutopilotState, RadioState
from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.namespace import frame
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.telemetry.parameter_check import ParameterWatch
from uam_sim_bridge.mavlink.telemetry.vitals import Battery

BATTERY_PERIOD = 1_000_000_000  # ns
SILENT = 0.1  # [s] after the newest tick from which this serves the link
WAKE_UP = 0.001  # [s] of wall time between two looks at the link: no other message announces it


class AutopilotTopics:
    """Publishes the reports of the bridge's stage, the battery once a second, and warnings."""

    def __init__(self, node: UamNode, link: OffboardLink) -> None:
        self._logger, self._link = node.get_logger(), link
        self._state = node.publisher(topics.AUTOPILOT_STATE)
        self._battery = node.publisher(topics.AUTOPILOT_BATTERY)
        self._last: AutopilotReport | None = None
        self._battery_stamp = -BATTERY_PERIOD
        self._warned: tuple[str, ...] = ()
        self._written, self._compared = 0, False

    def publish(self, stamp: int, report: AutopilotReport | None) -> None:
        """Publish and log at `stamp` [ns]; report: None if none is due."""
        self._publish_battery(stamp)
        self._log_warnings()
        if report is None:
            return
        if report.differs(self._last):
            armed = "armed" if report.armed else "disarmed"
            lost = "" if report.connected else ", no heartbeat"
            held = f": {report.released_to}, has control" if report.released_to else ""
            text = f"{report.phase.value}{held}; autopilot {report.mode.name}, {armed}{lost}"
            self._logger.info("; ".join((text, *report.reasons)))
        self._last = report
        told = report._asdict() | {"mode": report.mode.name, "reasons": "; ".join(report.reasons)}
        del told["phase"]
        message = AutopilotState(**told).to_message(stamp)
        if self._link.parameters.required:
            message.status = [*message.status, comparison(self._link.parameters).to_status()]
        received = {None: "", True: "yes", False: "no"}[self._link.vitals.radio]
        radio = RadioState(self._link.killed, received)
        message.status = [*message.status, *radio.to_message(stamp).status]
        self._state.publish(message)

    def _publish_battery(self, stamp: int) -> None:
        battery = self._link.vitals.battery
        if battery is not None and stamp - self._battery_stamp >= BATTERY_PERIOD:
            self._battery_stamp = stamp
            self._battery.publish(battery_message(stamp, battery))

    def _log_warnings(self) -> None:
        warnings = self._link.warnings
        for warning in warnings:
            if warning not in self._warned:
                self._logger.warning(warning)
        self._warned = warnings
        watch = self._link.parameters
        for text in watch.written[self._written :]:
            self._logger.info(text)
        self._written = len(watch.written)
        if watch.required and watch.complete and not self._compared:
            self._logger.info(comparison(watch).summary)
        self._compared = watch.complete


def comparison(watch: ParameterWatch) -> ParameterComparison:
    """Return the comparison of the autopilot's parameters with the required ones."""
    return ParameterComparison(
        sum(name in watch.values for name in watch.required),
        len(watch.expected),
        watch.complete,
        tuple(ParameterDifference(*difference) for difference in watch.differences),
    )


def battery_message(stamp: int, battery: Battery) -> BatteryState:
    """Return the message; stamp [ns]. NaN: unknown; `present` is False for an unknown voltage."""
    message = BatteryState(
        voltage=battery.voltage,
        temperature=battery.temperature,
        current=-battery.current,  # ROS: negative when discharging
        charge=math.nan,
        capacity=math.nan,
        design_capacity=math.nan,
        percentage=battery.left,
        present=math.isfinite(battery.voltage),
        cell_voltage=list(battery.cells),
    )
    set_stamp(message.header.stamp, stamp)
    return message


class CompanionClock:
    """The clock of the other sensors' stamps: the system's, or the topic /clock of a simulator."""

    def __init__(self, node: UamNode, simulated: bool) -> None:
        """simulated: listen to /clock."""
        self._simulated, self._stamp = simulated, 0
        if simulated:
            node.listen(topics.CLOCK, self._on_clock, required=False)

    def _on_clock(self, data: bytes) -> None:
        self._stamp = stamp_of(data)

    def now(self) -> float:
        """Return the time [s]; 0 before the first message of /clock."""
        return self._stamp / SECOND if self._simulated else time.time()


class AutopilotImuTopic:
    """Publishes the samples as they arrive. Before the first tick it also serves the link."""

    def __init__(self, node: UamNode, link: OffboardLink, clock: CompanionClock) -> None:
        self._link, self._clock = link, clock
        self._publisher = node.publisher(topics.IMU)
        self._writer = ImuWriter(frame(node, topics.BODY))
        self._count = 0

    def serve(self, tick: int | None) -> None:
        """Receive from the link and publish; tick [ns]: the newest, None before the first.

        The ticks send heartbeats and requests. Without ticks this does: a tick needs a sample, and
        a sample needs those, before the first tick and after a reboot of the autopilot.
        """
        now = self._clock.now()
        ticking = tick is not None and now - tick / SECOND < SILENT
        if ticking:
            now = tick / SECOND
        if now <= 0.0:
            return
        self._link.poll(now)
        if not ticking:
            self._link.maintain(now)
        for stamp, gyro, force in self._link.imu.samples():
            self._count += 1
            self._publisher.publish(self._writer.fill(stamp, gyro, force))

    def values(self) -> dict[str, object]:
        """Return the values for /diagnostics."""
        return {"IMU samples": self._count, "IMU samples refused": self._link.imu.refused}
