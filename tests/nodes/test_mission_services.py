"""The mission node: its services and the states that it publishes."""

import re
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import BatteryState, Temperature
from std_msgs.msg import Float64, Header
from vehicle_rig import PERIOD, Vehicle, take_off

from uam_control.coordinates import coordinates
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import checklist_message, read_checks
from uam_msgs_py.messages.control import read_reference
from uam_msgs_py.messages.convert import TrajectoryWriter
from uam_msgs_py.messages.status import ChecklistState, MissionStatus


@pytest.fixture
def vehicle(start, probe):
    node = start("uam_control.nodes.mission", "--ros-args", "-p", "scenario:=hover")
    made = Vehicle(probe)
    made.node = node
    made.fly(1)
    return made


def test_a_start_is_refused_with_the_checks_that_fail(vehicle):
    accepted, answer = vehicle.ask("start")
    assert not accepted and "autopilot: unknown (at most 0.75 s)" in answer
    vehicle.state[0, 7] = 0.0  # the second joint is not where the scenario begins
    vehicle.fly(2)
    accepted, answer = vehicle.ask("start")
    assert not accepted and "arm: 1.57 rad" in answer
    vehicle.until(lambda status: status.cause == "waiting for the start")


def test_a_simulation_slower_than_the_autopilots_clock_refuses_the_start(start, probe):
    module, arguments = "uam_control.nodes.mission", ("-p", "scenario:=hover")
    node = start(module, "--ros-args", *arguments, "-p", "autopilot_has_clock:=true")
    vehicle = Vehicle(probe)
    vehicle.node = node

    begun = time.monotonic()

    def slow():
        vehicle.fly(10)
        time.sleep(0.04)  # at most half as fast as the wall clock
        return time.monotonic() > begun + 1.5 and vehicle.stamp > 100 * PERIOD

    probe.until(slow, "ticks for longer than the window of the measurement")
    accepted, answer = vehicle.ask("start")
    (told,) = [part for part in answer.split("; ") if "simulation: " in part]
    assert not accepted and "unknown" not in told and "at most 0.1" in told


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
    vehicle.node.until_logged("frame_id 'alpha_9' is no joint")  # with the next diagnostics


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


def test_states_that_stop_in_flight_hand_over_to_the_autopilots_failsafe(start, probe):
    arguments = ("-p", "scenario:=hover", "-p", "state_timeout:=5.0")
    node = start("uam_control.nodes.mission", "--ros-args", *arguments)
    made = Vehicle(probe)
    made.node = node
    made.fly(1)
    take_off(made)
    further = TrajectoryWriter(coordinates(3))  # of another vehicle: no states

    def failed():
        made.states.publish(further.fill(made.stamp, np.zeros((3, 9))))
        return made.status.state == "failsafe"

    probe.until(failed, "the failsafe")
    (silence,) = re.findall(r"no state of the estimator for ([\d.]+) s", made.status.cause)
    assert float(silence) >= 5.0
    made.fly(1)  # a state that comes back changes nothing
    assert made.status.state == "failsafe"


def test_a_required_checklist_refuses_the_start_until_it_has_passed(start, probe):
    arguments = ("-p", "scenario:=hover", "-p", "require_checklist:=true")
    start("uam_control.nodes.mission", "--ros-args", *arguments)
    vehicle, reports = Vehicle(probe), probe.publisher(topics.CHECKLIST)
    probe.until_connected("mission", [reports], [])

    def report(**state):
        """Send a report, and go on until the pre-arm report has it."""
        sent = ChecklistState(**state)
        words = "passed" if sent.passed else sent.failing

        def known():
            reports.publish(checklist_message(vehicle.stamp, sent, []))
            vehicle.fly(10)
            found = {line[0]: line[1] for m in seen for line in read_checks(m)}
            return found.get("checklist") == words

        probe.until(known, f"the report {words}")

    seen = probe.collect(topics.PREFLIGHT)
    vehicle.tell()
    vehicle.fly(50)
    assert "checklist: no report (all items passed)" in vehicle.ask("start")[1]
    report(failing="battery; tilt_roll", step="tilt_roll", commands=True)
    assert vehicle.status.phase == "hand check"
    assert read_reference(vehicle.references[-1])[1].flying
    assert "refused: checklist: battery; tilt_roll (all items passed)" in vehicle.ask("start")[1]
    report(passed=True)
    assert not read_reference(vehicle.references[-1])[1].flying
    assert vehicle.ask("start") == (True, "arming")


def test_openings_of_a_gripper_close_open_or_are_refused(start, probe):
    """Its stroke is 20 to 75 mm; the plant takes an opening in between by the same rule."""
    arguments = "-p", "scenario:=hover", "-p", "vehicle:=s500_gripper"
    node = start("uam_control.nodes.mission", "--ros-args", *arguments)
    vehicle = Vehicle(probe)
    vehicle.node = node
    vehicle.fly(1)
    pad = probe.publisher(topics.GRIPPER_COMMAND)
    probe.until(lambda: pad.get_subscription_count(), "a subscription")
    for opening, answer, closed in (
        (0.02, "closes", True),
        (0.045, "opens", False),
        (0.02, "closes", True),
        (0.08, "refused: opening 0.08 is outside 0.02 to 0.075", True),
    ):
        pad.publish(Float64(data=opening))
        node.until_logged(f"gripper {opening:g}: {answer}")
        count = len(vehicle.magnet)
        vehicle.fly(3)
        probe.until(lambda count=count: len(vehicle.magnet) > count + 1, "the switch")
        assert vehicle.magnet[-1].data == closed
