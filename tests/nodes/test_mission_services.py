"""The mission node: its services and the states that it publishes."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import BatteryState, Temperature
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from uam_control.coordinates import coordinates
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import read_reference
from uam_msgs_py.messages.status import AutopilotState, MissionStatus
from uam_msgs_py.messages.trajectories import TrajectoryWriter

COORDINATES = coordinates(2)

PERIOD = 4_000_000  # [ns]


class Vehicle:
    """A vehicle that follows its reference exactly, one tick later."""

    def __init__(self, probe):
        self.probe, self.stamp = probe, 0
        self.states = probe.publisher(topics.STATE)
        self.autopilot = probe.publisher(topics.AUTOPILOT_STATE)
        self.battery = probe.publisher(topics.AUTOPILOT_BATTERY)
        self.references = probe.collect(topics.REFERENCE)
        self.magnet = probe.collect(topics.MAGNET)
        self.reported = probe.collect(topics.MISSION_STATUS)
        self.writer = TrajectoryWriter(COORDINATES)
        self.state = np.zeros((3, 8))
        self.state[0, 2], self.state[0, 7] = 0.28, np.pi / 2
        probe.until_connected(
            "mission",
            [self.states, self.autopilot, self.battery],
            [topics.REFERENCE, topics.MAGNET, topics.MISSION_STATUS],
        )

        self.armed = False

    def arm(self):
        self.armed = True
        self.tell()

    def tell(self):
        state = AutopilotState(True, "OFFBOARD", self.armed, 1 if self.armed else None)
        self.autopilot.publish(state.to_message(self.stamp))

    def fly(self, ticks):
        for _ in range(ticks):
            self.stamp += PERIOD
            if self.stamp % (50 * PERIOD) == 0:
                self.tell()
            before = len(self.magnet)
            self.states.publish(self.writer.fill(self.stamp, self.state))
            self.probe.until(lambda n=before: len(self.magnet) > n, "an answered tick")
            _, reference = read_reference(self.references[-1])
            if reference.flying:
                self.state[:2] = reference.values[:2]
                self.state[0, 2] = max(self.state[0, 2], 0.28)

    def until_state(self, state):
        for _ in range(3000):
            self.fly(1)
            if self.status.state == state:
                return
        raise AssertionError(f"still {self.status}")

    @property
    def status(self) -> MissionStatus:
        return MissionStatus.from_message(self.reported[-1])[1]

    def ask(self, name, on=None):
        kind = Trigger if on is None else SetBool
        request = Trigger.Request() if on is None else SetBool.Request(data=on)
        answer = self.probe.call(kind, f"/mission/{name}", request)
        return answer.success, answer.message


@pytest.fixture
def vehicle(start, probe):
    node = start("uam_control.nodes.mission", "--ros-args", "-p", "scenario:=hover")
    made = Vehicle(probe)
    made.node = node
    made.fly(1)
    return made


def take_off(vehicle):
    vehicle.arm()
    vehicle.until_state("taking off")
    assert vehicle.ask("hold") == (False, "refused: not while taking off")
    vehicle.until_state("flying")


def test_hold_resume_land_and_disarm_are_answered_and_executed(vehicle):
    take_off(vehicle)
    assert vehicle.ask("resume") == (False, "refused: not while flying")
    assert vehicle.ask("disarm") == (False, "refused: flying and not on the ground: land first")
    assert vehicle.ask("hold") == (True, "hold by command")
    vehicle.until_state("holding")
    assert vehicle.status.cause == "hold by command" and vehicle.status.phase == "hold"
    assert vehicle.ask("magnet", True)[0]
    vehicle.fly(2)
    vehicle.probe.until(lambda: vehicle.magnet[-1].data and vehicle.status.magnet, "the magnet")
    assert vehicle.ask("resume")[0]
    vehicle.until_state("flying")
    assert vehicle.ask("land") == (True, "land by command")
    vehicle.until_state("disarmed")
    assert vehicle.status.abort_reason == "land by command" and vehicle.status.phase == "landed"
    assert vehicle.ask("hold") == (False, "refused: not while disarmed")
    assert "holding: hold by command" in vehicle.node.output


def test_a_hot_servo_holds_and_an_unknown_joint_is_refused(vehicle, probe):
    temperatures = probe.publisher(topics.ARM_TEMPERATURE)
    probe.until_connected("mission", [temperatures], [])
    take_off(vehicle)
    for joint, degrees in (("alpha_9", 99.0), ("alpha_1", 40.0), ("alpha_2", 71.5)):
        temperatures.publish(Temperature(header=Header(frame_id=joint), temperature=degrees))
    vehicle.until_state("holding")
    assert vehicle.status.cause == "servo temperature 72 deg C exceeds 70 deg C"
    assert "frame_id 'alpha_9' is no joint" in vehicle.node.output


def test_an_empty_battery_lands_with_the_cause_in_the_diagnostics(vehicle, probe):
    received = []
    probe.node.create_subscription(
        DiagnosticArray, topics.DIAGNOSTICS.name, received.append, topics.DIAGNOSTICS.qos
    )
    take_off(vehicle)
    vehicle.battery.publish(BatteryState(percentage=0.1))
    vehicle.until_state("landing")
    assert vehicle.status.cause == "battery 0.10 full, below 0.15"

    def reported():
        vehicle.fly(1)
        found = [s for m in received for s in m.status if s.name == "mission"]
        values = {pair.key: pair.value for pair in found[-1].values} if found else {}
        return values.get("state") == "landing" and "battery" in values["cause"]

    probe.until(reported, "diagnostics of the landing")


def test_a_failsafe_is_published_before_its_idle_reference(vehicle):
    """The status must arrive first: idle commands in the air would make the bridge stop motors."""
    take_off(vehicle)
    for _ in range(150):
        vehicle.state[0, 3] = 1.2  # rad, beyond tilt_failsafe
        vehicle.fly(1)
    reported = [MissionStatus.from_message(message) for message in vehicle.reported]
    failed = min(stamp for stamp, status in reported if status.state == "failsafe")
    references = [read_reference(data) for data in vehicle.references]
    later = [(stamp, one.flying) for stamp, one in references if stamp >= failed]
    assert [flying for _, flying in later[:40]] == [True] * 40
    assert not later[-1][1]
