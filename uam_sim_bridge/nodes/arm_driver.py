"""Node: the arm's servos on a Dynamixel bus; replaces the simulator's joints on a vehicle.

/joint_states out at the control rate; joint efforts or goal positions in, as the vehicle's servos
are driven. A thread of its own exchanges goals and states with the servos at absolute deadlines of
the wall clock, so that a busy node does not delay the bus.
"""

import dataclasses
import math
import sys
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Temperature
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from uam_control.coordinates import ALPHA, CHI_DOT
from uam_control.nodes.described import described_vehicle
from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import ParameterError, Text
from uam_control.stamps import SECOND
from uam_control.vehicle import OpenEnd, VehicleDescription
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import read_reference
from uam_msgs_py.messages.convert import GRIPPER, JointStateWriter, read_joint_command
from uam_msgs_py.messages.ros_time import set_stamp
from uam_msgs_py.messages.status import ERROR, OK, WARN, AutopilotState
from uam_msgs_py.node.answering import offer
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.node_parameters import NodeParameters, declared_text, refuse_unknown
from uam_sim_bridge.devices.dynamixel.bus import BusLost
from uam_sim_bridge.devices.dynamixel.chain import (
    DEFAULT_HARDWARE,
    ArmChain,
    ArmError,
    hardware_file,
    load_chain,
)
from uam_sim_bridge.devices.dynamixel.driver import ArmDriver, Reading
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters
from uam_sim_bridge.nodes.late_device import LateDevice
from uam_sim_bridge.paced_clock import PacedClock

NAME = "arm_driver"
SWITCH = 0.0005  # [s] the bus thread waits at most so long for the interpreter; Python's is 5 ms
ABSENT_WAIT = 0.1  # [s] between two looks for an absent bus
SLOWEST = 0.95  # share of the rate below which the bus counts as too slow


class ArmDriverNode(UamNode):
    """Publishes the joints as read, and drives them by the newest command."""

    def __init__(self):
        super().__init__(NAME)
        self._thread: threading.Thread | None = None
        vehicle = described_vehicle(self)
        self._names = list(vehicle.joint_names)
        about = Text(
            "devices of the vehicle",
            "lab file with the section arm: name of a file in config/lab, or a file",
        )
        hardware = declared_text(self, "hardware", DEFAULT_HARDWARE, about)
        about = Text("serial device in place of the lab file's", "a path; empty: the file's")
        device = declared_text(self, "device", "", about)
        parameters = NodeParameters(self, ArmDriverParameters, read_only=True).current
        chain = _described_chain(hardware, device, vehicle)
        mode, gain = (vehicle.numbers["servos"][name] for name in ("mode", "position_p_gain"))
        self.driver = ArmDriver(chain, parameters, mode, vehicle.control_period, gain)
        self._bus = LateDevice(self, self._started, (ArmError, BusLost))
        self._velocity = None  # (n,) [rad/s] desired
        hand = [GRIPPER] if chain.gripper is not None else []
        self._writer = JointStateWriter([*self._names, *hand])
        if hand:
            self._stroke = vehicle.gripper.opening
            self._fingers = OpenEnd(self._stroke)
            self.listen(topics.MAGNET, self._on_grip)
            self.listen(
                topics.GRIPPER_COMMAND, lambda m: self._fingers.command(m.data), required=False
            )
        self._joints = self.publisher(topics.JOINTS)
        self._temperature = self.publisher(topics.ARM_TEMPERATURE)
        if self.driver.in_position_mode:
            self.listen(topics.ARM_GOALS, self._on_goals)
        else:
            self.listen(topics.ARM_EFFORT, self._on_effort)
        if parameters.friction_compensation:
            self.listen(topics.REFERENCE, self._on_reference)
        self._armed = False
        self.listen(topics.AUTOPILOT_STATE, self._on_autopilot, required=False)
        offer(self, Trigger, "~/reboot", self._on_reboot)
        offer(self, SetBool, "~/release", self._on_release)
        refuse_unknown(self)  # before the bus, which may be absent
        self._bus.begin()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._exchange, name="servo bus")
        self._thread.start()

    def _started(self) -> ArmDriver:
        """Start the driver; raises ArmError, BusLost."""
        driver = self.driver
        driver.start()
        for remark in driver.remarks:
            self.get_logger().warning(remark)
        budget = driver.budget
        self.get_logger().info(
            f"{len(self._names)} servos on {driver.chain.device}: {driver.rate:g} Hz, bus load "
            f"{100 * budget.load(driver.rate):.0f} %, up to {budget.rate:.0f} Hz"
        )
        return driver

    def _on_effort(self, data: bytes) -> None:
        self.driver.command_effort(read_joint_command(data, self._names), self._velocity)

    def _on_goals(self, data: bytes) -> None:
        self.driver.command_position(read_joint_command(data, self._names))

    def _on_grip(self, message: Bool) -> None:
        self._fingers.switch(message.data)
        self.driver.command_gripper(self._stroke[0] if message.data else self._fingers.opening)

    def _on_reference(self, data: bytes) -> None:
        reference = read_reference(data, len(self._names))[1]
        self._velocity = reference.values[CHI_DOT, ALPHA:].copy()

    def _on_reboot(self) -> tuple[bool, str]:
        if self._bus.problem:
            return False, self._bus.problem
        done = self.driver.reboot()
        success = bool(done) and not any("not rebooted" in line for line in done)
        return success, "; ".join(done) or "no servo has a hardware error"

    def _on_autopilot(self, message: DiagnosticArray) -> None:
        self._armed = AutopilotState.from_message(message)[1].armed
        if self._armed and self.driver.released:
            self.driver.release(False)

    def _on_release(self, released: bool) -> tuple[bool, str]:
        """Release the joints for the checklist, on a disarmed vehicle; or drive them again."""
        if self._bus.problem:
            return False, self._bus.problem
        if released and self._armed:
            return False, "refused: the vehicle is armed"
        failed = self.driver.release(released)
        done = "released: support the arm" if released else "driven again"
        return not failed, failed or done

    def _exchange(self) -> None:
        """Run the cycles until the node ends; an error that nothing handles ends the node."""
        try:
            while self._bus.attempt() is None:
                if self._ending.wait(ABSENT_WAIT):
                    return
            pace, cycle = PacedClock(1.0 / self.driver.rate, catch_up=math.inf), 0
            while not self._ending.is_set():
                pace.note(cycle)
                cycle += 1
                begun = time.perf_counter()
                reading = self.driver.cycle()
                if reading is not None:
                    self._publish(reading, begun)
                if left := pace.left(cycle):
                    time.sleep(left)
        except Exception as error:
            self.failure = f"{type(error).__name__}: {error}"

    def _publish(self, reading: Reading, begun: float) -> None:
        age = round((time.monotonic() - reading.time) * SECOND)
        stamp = self.get_clock().now().nanoseconds - age
        writer, n = self._writer, len(self._names)
        writer.position[:n], writer.velocity[:n] = reading.position, reading.velocity
        writer.effort[:n] = reading.effort
        if len(writer.position) > n:
            writer.position[n], writer.effort[n] = reading.grip
        self._joints.publish(writer.stamped(stamp))
        self.done_tick(stamp, begun)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        driver = self.driver
        self._publish_temperatures()
        rate, busy, longest = driver.meter.report()
        values: dict[str, object] = {
            "device": driver.chain.device,
            "bus rate [Hz]": f"{rate:.1f}",
            "bus rate possible [Hz]": f"{driver.budget.rate:.0f}",
            "cycle, budget [ms]": f"{1e3 * driver.budget.cycle:.2f}",
            "cycle, mean [ms]": f"{1e3 * busy:.2f}",
            "cycle, max [ms]": f"{1e3 * longest:.2f}",
            "latency timer [ms]": (
                "" if driver.latency_timer is None else f"{1e3 * driver.latency_timer:g}"
            ),
            "commands at the current limit": driver.saturated,
            "remarks at the start": "; ".join(driver.remarks),
        }
        for one in driver.health:
            values |= {
                f"{one.joint} temperature [deg C]": f"{one.temperature:.0f}",
                f"{one.joint} voltage [V]": f"{one.voltage:.1f}",
                f"{one.joint} torque": "on" if one.torque_on else "off",
                f"{one.joint} error": one.problem,
                f"{one.joint} missed reads": one.misses,
                f"{one.joint} restarts": one.restarts,
                f"{one.joint} watchdog trips": one.trips,
            }
        if self._bus.problem:
            return ERROR, self._bus.problem, values
        if driver.problems:
            return ERROR, "; ".join(driver.problems), values
        if math.isfinite(rate) and rate < SLOWEST * driver.rate:
            return WARN, f"bus at {rate:.0f} Hz, {driver.rate:g} Hz is needed", values
        if driver.released:
            return WARN, "released: the joints have no torque", values
        if driver.stale:
            return WARN, "no command within effort_timeout: zero torque", values
        return OK, "running", values

    def _publish_temperatures(self) -> None:
        """Publish what the supervisor limits, once a second; a lost servo has none."""
        now = self.get_clock().now().nanoseconds
        for one in self.driver.health:
            if math.isfinite(one.temperature) and not one.lost:
                message = Temperature(temperature=one.temperature)
                message.header.frame_id = one.joint
                set_stamp(message.header.stamp, now)
                self._temperature.publish(message)

    def destroy_node(self) -> None:
        """End the thread, and the servos as configured."""
        if self._thread is not None:
            self._ending.set()
            self._thread.join()
        if hasattr(self, "driver"):
            self.driver.stop()
        super().destroy_node()


def _described_chain(hardware: str, device: str, vehicle: VehicleDescription) -> ArmChain:
    """Return the chain of a lab file, on its own or another device.

    Raises ParameterError, ArmError.
    """
    try:
        chain = load_chain(hardware_file(hardware), vehicle)
    except ConfigurationError as error:
        raise ParameterError(f"hardware: {error}") from None
    return dataclasses.replace(chain, device=device) if device else chain


def main() -> int:
    sys.setswitchinterval(SWITCH)
    return run(ArmDriverNode, NAME)
