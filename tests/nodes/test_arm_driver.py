"""The arm's driver over real ROS, with emulated servos behind a pseudo-terminal."""

import math

import numpy as np
import pytest
from arm_rig import BAUD, STOWED
from servo_shafts import StillShaft
from std_srvs.srv import SetBool, Trigger

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import JointCommandWriter, read_joints, read_values
from uam_msgs_py.messages.status import ERROR, OK, WARN, AutopilotState
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedBus, EmulatedServo

MODULE = "uam_sim_bridge.nodes.arm_driver"
NAMES = ["alpha_1", "alpha_2"]
# On a busy machine answers may take long: only a servo that is really lost is waited for. A servo's
# watchdog has the largest time. A start without answers is tried again.
PATIENT = (
    *("answer_timeout:=0.3", "watchdog:=2.5", "slow_interval:=0.02", "effort_timeout:=1.0"),
    "wait_for_device:=true",
)


class Arm:
    """The emulated arm, the node that drives it, and what the probe hears of it."""

    def __init__(self, probe, start, folder, *settings):
        self.probe = probe
        self.shafts = [StillShaft(angle) for angle in STOWED]
        servos = [EmulatedServo(i + 1, one, baud_rate=BAUD) for i, one in enumerate(self.shafts)]
        self.bus = EmulatedBus(servos, link=folder / "ttyARM")
        self.efforts = probe.publisher(topics.ARM_EFFORT)
        self.joints = probe.collect(topics.JOINTS)
        self.temperatures = probe.collect(topics.ARM_TEMPERATURE)
        self.diagnostics = probe.collect(topics.DIAGNOSTICS)
        settings = (f"device:={self.bus.port}", *PATIENT, *settings)
        self.node = start(MODULE, "--ros-args", *(w for one in settings for w in ("-p", one)))
        self.writer = JointCommandWriter(2)

    def until_driven(self, effort, condition, what):
        """Send efforts until `condition()`."""

        def met():
            self.efforts.publish(self.writer.fill(np.array(effort)))
            return condition()

        self.probe.until(met, what)

    @property
    def status(self):
        """The node's newest status, None before the first."""
        found = [s for m in self.diagnostics for s in m.status if s.name == "arm_driver"]
        return found[-1] if found else None

    @property
    def values(self):
        """The values of that status."""
        return {pair.key: pair.value for pair in self.status.values}

    def reports(self, level, text=""):
        return self.status and self.status.level == level and text in self.status.message

    def draws(self, currents):
        return None not in self.currents and np.allclose(self.currents, currents, atol=0.002)

    @property
    def currents(self):
        return [shaft.last.current if shaft.last.on else None for shaft in self.shafts]


@pytest.fixture
def arm(probe, start, tmp_path):
    made = []

    def make(*settings):
        made.append(Arm(probe, start, tmp_path, *settings))
        return made[-1]

    yield make
    for one in made:
        one.bus.close()


def test_joints_out_efforts_in_and_the_end(arm, probe):
    rig = arm("answer_timeout:=1.0")  # of the end, too: this process answers for the servos
    driven = [0.5 / 1.304, -0.3 / 1.304]
    rig.until_driven([0.5, -0.3], lambda: rig.draws(driven), "the efforts")
    probe.until(lambda: rig.joints, "joint states")
    stamp, position, velocity = read_joints(rig.joints[-1], NAMES)
    assert position == pytest.approx(STOWED, abs=2e-3) and velocity == pytest.approx([0.0, 0.0])
    assert abs(stamp - probe.node.get_clock().now().nanoseconds) < 60e9
    rig.until_driven(
        [0.5, -0.3],
        # on a busy machine the bus is slower than the control rate, which is a warning
        lambda: (
            (rig.reports(OK) or rig.reports(WARN, "bus at")) and "nan" not in rig.values.values()
        ),
        "a report without an error of servos that have all been read",
    )
    assert rig.values["alpha_2 temperature [deg C]"] == "35"
    assert rig.values["alpha_1 torque"] == "on"
    assert float(rig.values["bus rate possible [Hz]"]) > 900.0

    def temperatures():
        return {m.header.frame_id: m.temperature for m in rig.temperatures}

    rig.until_driven([0.5, -0.3], lambda: len(temperatures()) > 1, "temperatures")
    assert temperatures() == {"alpha_1": 35.0, "alpha_2": 35.0}

    def measured():
        _, names, effort = read_values(rig.joints[-1], "effort")
        assert names == NAMES
        return effort == pytest.approx([0.5, -0.3], abs=0.002)

    rig.until_driven([0.5, -0.3], measured, "the measured efforts")  # zero after late commands
    # the controller falls silent
    probe.until(lambda: rig.currents == [0.0, 0.0], "zero torque without commands")
    probe.until(lambda: rig.reports(WARN, "zero torque") or rig.reports(b"\x03"), "the warning")
    assert rig.node.interrupt() == 0, rig.node.output
    assert rig.currents == [None, None]


def test_a_lost_servo_stops_the_joints_and_is_named(arm, probe):
    rig = arm("missed_reads:=2")
    probe.until(lambda: rig.joints and None not in rig.currents, "joint states")
    rig.bus.line.servos[1].connected = False
    probe.until(lambda: rig.reports(ERROR, "alpha_2 (id 2): no answer to the last"), "the error")
    count = len(rig.joints)
    before = rig.status
    probe.until(lambda: rig.status is not before, "the next report")
    assert len(rig.joints) == count
    rig.bus.line.mend()
    probe.until(lambda: len(rig.joints) > count, "joint states again")


def test_a_hardware_error_is_reported_and_rebooted_on_request(arm, probe):
    rig = arm()
    probe.until(lambda: rig.joints and None not in rig.currents, "torque")
    rig.bus.line.servos[0].raise_error("overload")
    probe.until(lambda: rig.reports(ERROR, "alpha_1 (id 1): overload"), "the error")
    answers = []

    def rebooted():
        answers.append(probe.call(Trigger, "arm_driver/reboot", Trigger.Request()))
        if not answers[-1].success:  # it answered late, but has restarted: the error once more
            rig.bus.line.servos[0].raise_error("overload")
        return answers[-1].success

    probe.until(rebooted, "the reboot")
    assert answers[-1].message == "alpha_1 (id 1): rebooted after overload"
    probe.until(lambda: None not in rig.currents, "torque again")
    answer = probe.call(Trigger, "arm_driver/reboot", Trigger.Request())
    assert not answer.success and answer.message == "no servo has a hardware error"


def test_an_unplugged_device_is_named_and_used_again(arm, probe):
    rig = arm("reopen_interval:=0.05")
    probe.until(lambda: rig.joints, "joint states")
    rig.bus.unplug()
    probe.until(lambda: rig.reports(ERROR, "ttyARM"), "the error")
    count = len(rig.joints)
    rig.bus.plug_in()
    probe.until(lambda: len(rig.joints) > count, "joint states again")


def test_a_missing_device_is_refused_in_one_line(start):
    node = start(MODULE, "--ros-args", "-p", "device:=/dev/ttyNONE")
    assert node.process.wait(60) == 2
    assert node.output == "arm_driver: /dev/ttyNONE: does not exist\n"


@pytest.mark.parametrize(
    "setting, reason",
    [
        ("missed_reads:=0", "missed_reads: 0 is outside 1 to 1000"),
        ("ends_with:=brake", "ends_with: 'brake' is not one of torque_off, hold"),
        ("hardware:=none", "hardware: unknown lab 'none'; there are: "),
        ("speed:=1", "speed: unknown; allowed: answer_timeout, "),
    ],
)
def test_a_bad_parameter_is_refused_in_one_line(start, setting, reason):
    node = start(MODULE, "--ros-args", "-p", setting)
    assert node.process.wait(60) == 2
    assert reason in node.output and node.output.count("\n") == 1, node.output


def test_goal_positions_for_servos_in_position_mode(probe, start, arm, tmp_path):
    from uam_control.settings import configuration

    text = (configuration.root() / "vehicle/s500_arm.yaml").read_text()
    folder = configuration.root() / "vehicle"
    text = text.replace("mode: current", "mode: position")
    text = text.replace("model: s500_arm.xml", f"model: {folder / 's500_arm.xml'}")
    file = tmp_path / "goals.yaml"
    file.write_text(text)
    rig = arm(f"vehicle:={file}")
    goals = probe.publisher(topics.ARM_GOALS)

    def met():
        goals.publish(rig.writer.fill(np.array([0.2, 1.0])))
        return all(shaft.last.on for shaft in rig.shafts) and np.allclose(
            [shaft.last.position for shaft in rig.shafts], [0.2, 1.0], atol=2e-3
        )

    probe.until(met, "the goals")
    assert [shaft.last.mode for shaft in rig.shafts] == [3, 3]
    assert math.isclose(rig.shafts[0].angle, STOWED[0])


def test_joints_are_released_for_the_checklist_and_never_on_an_armed_vehicle(arm, probe):
    rig = arm()
    autopilot = probe.publisher(topics.AUTOPILOT_STATE)
    effort, driven = [0.5, -0.3], [0.5 / 1.304, -0.3 / 1.304]

    def release(on):
        answer = probe.call(SetBool, "arm_driver/release", SetBool.Request(data=on))
        return answer.success, answer.message

    def arm_vehicle(armed):
        autopilot.publish(AutopilotState(True, "OFFBOARD", armed).to_message(1))

    rig.until_driven(effort, lambda: rig.draws(driven), "the efforts")
    assert release(True) == (True, "released: support the arm")
    rig.until_driven(effort, lambda: rig.draws([0.0, 0.0]), "no torque")
    assert release(False) == (True, "driven again")
    rig.until_driven(effort, lambda: rig.draws(driven), "the efforts again")
    release(True)

    def refused():
        arm_vehicle(True)
        return release(True) == (False, "refused: the vehicle is armed")

    probe.until(refused, "the refusal")
    rig.until_driven(effort, lambda: rig.draws(driven), "an armed vehicle drives its arm")
