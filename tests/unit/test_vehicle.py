"""What `uam vehicle` says about devices, which nodes it starts, and how it ends."""

from __future__ import annotations

import sys
from dataclasses import replace
from io import StringIO
from unittest.mock import Mock

import pytest

pytest.importorskip("rclpy")

from uam_control.offboard.autopilot_magnet import AutopilotMagnetParameters
from uam_lab.cli.main import main
from uam_lab.flights.observer import STARTING, DeviceState, FlightStatus
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.progress import Progress, device_table
from uam_lab.flights.vehicle import vehicle_engine, vehicle_nodes
from uam_lab.flights.vehicle.devices import Report, devices
from uam_lab.flights.vehicle.lab_file import Magnet, load_lab, settings_of, template
from uam_lab.flights.vehicle.vehicle_engine import FlightRun, VehicleCourse
from uam_lab.records.results.result_folder import ResultFolder
from uam_lab.records.results.terminal import Terminal
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import ERROR, OK, STALE
from uam_msgs_py.node import wiring
from uam_msgs_py.node.rightful import RightfulNodes

LAB = load_lab("s500_lab")
GRIPPER = replace(LAB, magnet=Magnet("autopilot", output=AutopilotMagnetParameters("gripper")))
FOREIGN = replace(LAB, mocap=None, imu="topic", magnet=Magnet("none"))


def states(lab, **reports):
    return {one.name: one.state(reports) for one in devices(lab)}


def test_without_reports_every_device_is_missing_and_has_an_advice():
    found = states(LAB)
    assert list(found) == ["motion capture", "arm", "magnet", "autopilot", "imu"]
    assert all(not one.present and one.text == STARTING and one.advice for one in found.values())
    assert "ping 192.168.1.5" in found["motion capture"].advice
    assert f"uam arm --config {LAB.file}" in found["arm"].advice
    assert "/dev/gpiochip0" in found["magnet"].advice
    assert "SER_TEL2_BAUD 921600" in found["autopilot"].advice


def test_the_diagnostics_of_the_drivers_say_what_is_there():
    found = states(
        LAB,
        mocap_driver=Report(ERROR, "no answer of 192.168.1.5:1510"),
        arm_driver=Report(STALE, "waiting for /arm_effort_controller/commands"),
        magnet_driver=Report(OK, "magnet off"),
        mavlink_bridge=Report(OK, "", {"heartbeat": "False", "link open": "False"}),
        state_estimator=Report(OK, "", {"age of /imu/data [ms]": ""}),
    )
    assert {name: one.present for name, one in found.items()} == {
        "motion capture": False, "arm": True, "magnet": True, "autopilot": False, "imu": False,
    }  # fmt: skip
    assert found["motion capture"].text == "no answer of 192.168.1.5:1510"
    assert found["autopilot"].text.endswith("cannot be opened; is it plugged in?")
    assert found["imu"].text == "no message on /imu/data"


@pytest.mark.parametrize(
    ("values", "present", "text"),
    [
        ({"heartbeat": "True", "autopilot mode": "HOLD"}, True, "mode HOLD; disarmed"),
        ({"heartbeat": "False", "link open": "True"}, False, f"{LAB.autopilot}: no heartbeat"),
    ],
)
def test_the_autopilot_is_there_by_its_heartbeat(values, present, text):
    report = Report(OK, "disarmed", values)
    found = states(LAB, mavlink_bridge=report)["autopilot"]
    assert (found.present, found.text) == (present, text)


@pytest.mark.parametrize(
    ("age", "present"), [("4.0", True), ("1400", True), ("1600", False), ("9000.5", False)]
)
def test_a_sensor_is_there_while_its_messages_come(age, present):
    values = {"age of /uav1/imu/data [ms]": age, "age of /joint_states [ms]": "1.0"}
    assert states(LAB, state_estimator=Report(OK, "", values))["imu"].present is present


def test_a_magnet_at_the_autopilot_is_there_once_acknowledged():
    for value, present in (("", False), ("False", True), ("True", True)):
        found = states(GRIPPER, mavlink_bridge=Report(OK, "", {"magnet": value}))["magnet"]
        assert found.present is present
    assert "PD_GRIPPER_TYPE 0" in found.advice


def test_each_laboratory_has_its_drivers():
    assert set(vehicle_nodes.DRIVERS) < set(vehicle_nodes.modules(LAB))
    assert "magnet_driver" not in vehicle_nodes.modules(GRIPPER)
    started = vehicle_nodes.modules(FOREIGN)
    assert not {"mocap_driver", "magnet_driver", "mujoco_sim"} & set(started)
    assert list(started)[0] == "recorder"
    assert "magnet" not in states(FOREIGN)


def test_the_nodes_work_on_the_wall_clock_and_wait_for_their_devices(tmp_path):
    sections = vehicle_nodes.parameters(LAB, settings_of(LAB), ResultFolder(tmp_path))
    assert sections["recorder"]["simulated"] is False
    bridge = sections["mavlink_bridge"]
    assert (bridge["clock"], bridge["imu_clock"]) == ("realtime", "system")
    assert bridge["autopilot"] == LAB.autopilot and bridge["imu_source"] == "autopilot"
    waiting = ("mocap_driver", "arm_driver", "magnet_driver", "mavlink_bridge")
    assert all(sections[node]["wait_for_device"] for node in waiting)
    mission = sections["mission"]
    assert mission["auto_start"] is False and mission["state_timeout"] > 0.0
    assert (mission["geofence_low"], mission["geofence_high"]) == (
        list(LAB.room.low), list(LAB.room.high),
    )  # fmt: skip
    assert sections["arm_driver"]["hardware"] == str(LAB.file)
    assert mission["require_checklist"] is True
    checklist = sections["checklist"]
    assert checklist["room_high"] == list(LAB.room.high) and checklist["magnet"] is True
    assert set(checklist["nodes"].split(",")) == set(vehicle_nodes.modules(LAB)) - {
        *("checklist", "cockpit"),
    }


def test_in_the_fused_layout_one_process_has_the_control_nodes(tmp_path):
    lab = replace(LAB, fused=True)
    sections = vehicle_nodes.parameters(lab, settings_of(lab), ResultFolder(tmp_path))
    assert sections[wiring.FLIGHT_CONTROLLER] == {"without": ""}
    own = set(vehicle_nodes.modules(lab)) - set(wiring.FUSED)
    assert set(vehicle_nodes.processes(lab)) == own | {wiring.FLIGHT_CONTROLLER}
    checked = sections["checklist"]["nodes"].split(",")
    assert set(wiring.FUSED) <= set(checked), "each node reports by its own name"


def test_the_drivers_run_with_the_priority_of_the_nodes_behind_them(tmp_path):
    """With the control nodes alone ahead, the joint angles came at 30 Hz on a busy computer."""
    lab = replace(LAB, process={"fifo_priority": 50, "busy_poll": 0.001})
    sections = vehicle_nodes.parameters(lab, settings_of(lab), ResultFolder(tmp_path))
    for driver in vehicle_nodes.DRIVERS:
        assert sections[driver]["fifo_priority"] == 50
        assert "busy_poll" not in sections[driver], "a driver has no tick to wait for"
    assert sections[wiring.RECORDER]["fifo_priority"] == 1  # it loses messages if it starves
    assert "fifo_priority" not in sections[wiring.COCKPIT]


def test_the_connections_of_a_vehicle_have_no_plant():
    for lab in (LAB, GRIPPER, FOREIGN):
        started = set(vehicle_nodes.modules(lab))
        for wire in vehicle_nodes.wires(lab):
            assert {wire.publisher, *wire.subscribers} <= started, wire
    magnet = {w.topic: w.subscribers for w in vehicle_nodes.wires(GRIPPER)}[topics.MAGNET]
    assert magnet == (wiring.BRIDGE,)
    assert topics.MOCAP not in [w.topic for w in vehicle_nodes.wires(FOREIGN)]


def test_only_the_drivers_may_publish_the_sensors():
    nodes = RightfulNodes("/", vehicle_nodes.publishers(LAB))
    found = {topic: nodes.of(topic.name) for topic in (topics.IMU, topics.MOCAP, topics.JOINTS)}
    assert {topic: one.name for topic, one in found.items()} == {
        topics.IMU: "/mavlink_bridge", topics.MOCAP: "/mocap_driver", topics.JOINTS: "/arm_driver",
    }  # fmt: skip
    assert all(one.only for one in found.values())
    assert not RightfulNodes("/", vehicle_nodes.publishers(FOREIGN)).of(topics.IMU.name).only


def test_lines_without_a_terminal_say_each_change_once():
    shown = StringIO()
    progress = Progress(Terminal(file=shown, width=200))
    missing = DeviceState("arm", False, "/dev/ttyARM: does not exist", "uam arm")
    there = DeviceState("arm", True, "open", "uam arm")
    silent, still = (replace(missing, text=f"no answer for {age} s") for age in (2, 3))
    starting, warm = replace(missing, text=STARTING), replace(there, text="bus at 218 Hz")
    for state in (starting, missing, missing, there, warm, there, missing, silent, still):
        progress.bring_up([state])
    line = "arm: missing: /dev/ttyARM: does not exist; check: uam arm"
    last = "arm: missing: no answer for 2 s; check: uam arm"
    assert shown.getvalue().splitlines() == [line, "arm: present: open", line, last]


def test_on_a_terminal_there_is_one_table_until_all_devices_are_there():
    shown = StringIO()
    console = Terminal(file=shown, width=120, force_terminal=True)
    missing = DeviceState("arm", False, "/dev/ttyARM: does not exist", "uam arm")
    with Progress(console) as progress:
        progress.bring_up([missing, DeviceState("imu", True, "messages on /imu/data", "hz")])
    for text in ("device", "check by", "missing", "/dev/ttyARM: does not exist", "uam arm"):
        assert text in shown.getvalue()
    assert "hz" not in shown.getvalue()  # nothing is to be checked
    assert device_table([missing]).row_count == 1


class Listener:
    """Has the newest status of the mission."""

    newest: list[FlightStatus] = []


def course(status, stop):
    """A course with that status, without ROS; its commands to land are counted."""
    made = VehicleCourse.__new__(VehicleCourse)
    made.listener, made._stop, made._done_at, made._landing = Listener(), stop, None, False
    made.listener.newest = [] if status is None else [status]
    made.landings = []
    made._look, made._land = (lambda now: None), lambda: made.landings.append(1)
    return made


def status(state, done=False):
    return FlightStatus("hover", 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, state=state, done=done)


@pytest.mark.parametrize("state", ["grounded", "failsafe", "released", "disarmed", None])
def test_a_stop_ends_the_nodes_where_the_companion_does_not_fly(state):
    stop = StopRequest()
    made = course(state and status(state), stop)
    assert made.goes_on()
    stop.repeat()
    assert not made.goes_on() and not made.landings


@pytest.mark.parametrize("state", ["taking off", "flying", "holding", "landing"])
def test_in_the_air_the_first_stop_lands_and_the_second_one_ends(state):
    stop = StopRequest()
    made = course(status(state), stop)
    stop.repeat()
    assert made.goes_on() and made.landings
    stop.repeat()
    assert not made.goes_on()


def test_the_flight_ends_some_time_after_the_mission(monkeypatch):

    now = [100.0]
    monkeypatch.setattr(vehicle_engine.time, "monotonic", lambda: now[0])
    made = course(status("disarmed", done=True), StopRequest())
    assert made.goes_on()
    now[0] += vehicle_engine.LINGER - 0.1
    assert made.goes_on()
    now[0] += 0.2
    assert not made.goes_on()


def test_the_command_prints_template_and_unit(capsys, monkeypatch, tmp_path):
    assert main(["vehicle", "--example"]) == 0
    assert capsys.readouterr().out == template()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["/opt/uam/bin/uam"])
    (tmp_path / "my lab.yaml").write_text(template())
    assert main(["vehicle", "--config", "my lab.yaml", "--systemd"]) == 0
    unit = capsys.readouterr().out
    assert f"ExecStart=/opt/uam/bin/uam vehicle --config '{tmp_path}/my lab.yaml'\n" in unit
    assert f"WorkingDirectory={tmp_path}\n" in unit and "@" not in unit


def test_wrong_use_is_refused_in_one_line(capsys, tmp_path):
    assert main(["vehicle"]) == 2
    assert "--config LAB is missing; uam vehicle --example prints" in capsys.readouterr().err
    (tmp_path / "lab.yaml").write_text(template().replace("[-2.0, 2.0]", "[2.0, -2.0]"))
    assert main(["vehicle", "--config", str(tmp_path / "lab.yaml")]) == 2
    assert "room.x: 2 is not below -2" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [tmp_path / "lab.yaml"]


def test_the_flight_of_a_vehicle_continues_without_recorder_and_cockpit(tmp_path):
    flight = FlightRun(settings_of(LAB), ResultFolder(tmp_path), None, None, None, "")
    course = VehicleCourse(LAB, flight)
    course.children = Mock()
    course.start()
    started = course.children.start.call_args_list
    optional = {call.args[0] for call in started if call.kwargs["optional"]}
    assert optional == {"recorder", "cockpit"}
