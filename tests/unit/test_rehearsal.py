"""The laboratory of a rehearsal: its clock, its cameras, its person, its wiring and its cables."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from set_clock import SetClock

from uam_control.maths.rotations import quaternion_from_euler
from uam_control.vehicle import load_description
from uam_lab.flights.rehearsal.engine import RehearsalCourse
from uam_lab.flights.vehicle.vehicle_engine import VehicleCourse
from uam_sim_bridge.devices.dynamixel.chain import hardware_file, load_chain
from uam_sim_bridge.devices.mocap import calibration
from uam_sim_bridge.devices.mocap.calibration import Calibration
from uam_sim_bridge.devices.mocap.frame import BodyPose
from uam_sim_bridge.faults import CABLE, FAULTS, FaultError, Schedule
from uam_sim_bridge.faults.schedule import timed
from uam_sim_bridge.faults.timeline import Timeline
from uam_sim_bridge.laboratory.laboratory import Laboratory
from uam_sim_bridge.laboratory.laboratory_parameters import LaboratoryParameters
from uam_sim_bridge.laboratory.person import Person
from uam_sim_bridge.laboratory.set_up import RoomBody, mistaken_chain
from uam_sim_bridge.paced_clock import CATCH_UP, LATEST, PacedClock
from uam_sim_bridge.plant import Vehicle

VEHICLE = load_description()
CHAIN = load_chain(hardware_file("s500_lab"), VEHICLE)
PERIOD = 0.004
NOW = 1.8e9  # [s] of the host


def mistakes(name, **values):
    return Schedule((timed({"fault": name, "at": "start", **values}, {}, "test"),))


# --- the clock ---------------------------------------------------------------------------------


def test_ticks_are_due_one_period_apart_and_have_the_system_time():
    steady, system = SetClock(5.0), SetClock(1000.0)
    clock = PacedClock(PERIOD, steady, system)
    clock.begin()
    assert clock.host(0) == 1000.0 and clock.host(250) == pytest.approx(1001.0)
    clock.note(0)
    assert clock.left(1) == pytest.approx(PERIOD)
    steady.now += PERIOD
    assert clock.left(1) == 0.0


@given(st.floats(0.009, 2.0))
def test_after_a_stall_ticks_run_faster_until_they_are_on_time(stall):
    steady = SetClock()
    clock = PacedClock(PERIOD, steady, SetClock())
    clock.begin()
    clock.note(0)
    steady.now = stall
    began, tick = steady.now, 1
    clock.note(tick)
    while steady.now - tick * PERIOD - clock.lost > PERIOD:
        steady.now += max(clock.left(tick + 1), 1e-4)
        tick += 1
        clock.note(tick)
        assert tick < 5000
    took, done = steady.now - began, (tick - 1) * PERIOD
    assert done <= CATCH_UP * took + 2 * PERIOD
    assert (clock.lost > 0.0) == (stall - PERIOD > LATEST)
    assert clock.late > 0


# --- the cameras -------------------------------------------------------------------------------

angle = st.floats(-3.0, 3.0)
place = st.tuples(*[st.floats(-5.0, 5.0)] * 3)


@st.composite
def calibrations(draw):
    body = quaternion_from_euler(np.array([draw(angle), draw(st.floats(-1.4, 1.4)), draw(angle)]))
    return Calibration(
        draw(st.sampled_from("yz")), draw(angle), draw(place), tuple(body), draw(place), {}
    )


@given(calibrations(), place, angle, st.floats(-1.4, 1.4), angle)
def test_the_driver_finds_the_pose_that_the_cameras_saw(made, position, roll, pitch, yaw):
    quaternion = quaternion_from_euler(np.array([roll, pitch, yaw]))
    at, (x, y, z, w) = RoomBody("uam", made).seen(np.array(position), quaternion)
    found = made.convert(BodyPose(np.array(at), np.array([w, x, y, z])))
    assert found[0] == pytest.approx(position, abs=1e-6)
    assert abs(found[1] @ quaternion) == pytest.approx(1.0, abs=1e-9)


def test_wrong_cameras_give_another_pose():
    nominal = calibration.load("motive_y_up")
    level, position = np.array([1.0, 0.0, 0.0, 0.0]), np.array([1.0, 2.0, 3.0])

    def driver(body):
        at, (x, y, z, w) = body.seen(position, level)
        return nominal.convert(BodyPose(np.array(at), np.array([w, x, y, z])))

    at, _ = driver(RoomBody("uam", nominal, other_axis=True))
    assert at == pytest.approx([1.0, -3.0, 2.0], abs=1e-6)  # y and z are exchanged
    at, turned = driver(RoomBody("uam", nominal, turn=math.radians(90.0)))
    assert at == pytest.approx(position, abs=1e-6)
    right = quaternion_from_euler(np.array([0.0, 0.0, math.radians(-90.0)]))
    assert abs(turned @ right) == pytest.approx(1.0, abs=1e-9)


# --- wiring ------------------------------------------------------------------------------------


def test_wiring_mistakes_by_hand():
    first, second = CHAIN.servos
    found = mistaken_chain(CHAIN, mistakes("wrong_id", joint=2, id=9))
    assert [one.id for one in found] == [1, 9]
    found = mistaken_chain(CHAIN, mistakes("joints_swapped"))
    assert [one.id for one in found] == [2, 1] and found[0].joint == "alpha_1"
    found = mistaken_chain(CHAIN, mistakes("direction_reversed", joint=1))
    assert found == (replace(first, direction=-1), second)
    found = mistaken_chain(CHAIN, mistakes("zero_shifted", joint=2, turn=90.0))
    assert found[1].zero == second.zero + 1024
    with pytest.raises(FaultError, match="joint 3: the vehicle has 2"):
        mistaken_chain(CHAIN, mistakes("direction_reversed", joint=3))


# --- the laboratory as a whole, without pace ---------------------------------------------------


@pytest.fixture
def laboratory(tmp_path, free_ports):
    made = []

    def make(*wiring, magnet=True, **output):
        parameters = LaboratoryParameters(
            folder=str(tmp_path),
            mocap_port=0,
            hil_port=free_ports(),
            magnet="gpio" if magnet else "autopilot",
            magnet_line=str(tmp_path / "line"),
            **output,
        )
        schedule = Schedule(tuple(one for s in wiring for one in s.faults))
        cameras = calibration.load("motive_y_up")
        made.append(Laboratory(Vehicle.of(VEHICLE), parameters, CHAIN, cameras, schedule))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def free_ports():
    import socket

    def port():
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            return probe.getsockname()[1]

    return port


def ticks(lab, count, person=None, step=""):
    for _ in range(count):
        _, truth = lab.sense(NOW + lab.plant.time)
        if person is not None:
            lab.grip = person.update(lab.plant.time, step, truth.state[0])
        lab.step(np.zeros(4), truth)
    return truth


def test_servos_turn_the_joints_of_the_plant_and_read_them(laboratory):
    lab = laboratory()
    truth = ticks(lab, 200)  # no torque yet: hands hold the arm
    assert truth.state[0, 6:] == pytest.approx(VEHICLE.stowed, abs=0.06)
    servo, described = lab.servos[0], CHAIN.servos[0]
    before = lab.plant.truth().state[0, 6]
    servo.set("Torque Enable", 1)
    assert servo.write(described.table["Goal Current"].address, (200).to_bytes(2, "little")) == 0
    ticks(lab, 50)  # 200 x 2.69 mA x 1.304 N m/A = 0.7 N m
    angle = lab.plant.truth().state[0, 6]
    assert angle > before + 0.1
    ticks(lab, 1)
    servo.read(0, 1)
    read = described.angle(servo.get("Present Position"))
    assert read == pytest.approx(angle, abs=0.05)
    assert lab.plant.servos.torque[0] == pytest.approx(200 * 0.00269 * 1.304, rel=0.01)


def test_the_line_switches_the_magnet_unless_its_wire_is_pulled(laboratory):
    lab = laboratory()
    for content, plugged, expected in (("1", True, True), ("0", True, False), ("1", False, False)):
        lab.parameters.gpio.write_text(content)
        lab.magnet_plugged = plugged
        ticks(lab, 1)
        assert lab.magnet is expected
    lab.parameters.gpio.unlink()
    lab.magnet_plugged = True
    ticks(lab, 1)
    assert lab.magnet is False


def test_an_inverted_magnet_and_one_of_the_autopilot(laboratory):
    lab = laboratory(mistakes("magnet_inverted"))
    lab.parameters.gpio.write_text("0")
    ticks(lab, 1)
    assert lab.magnet is True
    other = laboratory(magnet=False)
    for value, expected in ((1.0, True), (-1.0, False), (0.0, False)):
        other.hil.controls[10] = value  # actuator 1 of the six last controls
        ticks(other, 1)
        assert other.magnet is expected


def test_a_magnet_is_on_where_the_output_is_nearer_to_its_value_for_on(laboratory):
    lab = laboratory(magnet=False, magnet_output=2, magnet_on=-1.0, magnet_off=0.5)
    for value, expected in ((-1.0, True), (0.5, False), (0.0, False), (1.0, False)):
        lab.hil.controls[11] = value
        ticks(lab, 1)
        assert lab.magnet is expected


def test_the_person_lifts_tilts_and_sets_the_vehicle_down(laboratory):
    lab = laboratory()
    person, tilts = Person(VEHICLE.joint_names, VEHICLE.stowed), []
    start = ticks(lab, 50).state[0].copy()
    for step in ("hands_on", "tilt_roll", "clear"):
        while not person.done or person.done[-1] != step:
            truth = ticks(lab, 5, person, step)
            tilts.append(truth.state[0, 3])
            assert lab.plant.time < 60.0
    assert max(tilts) > 0.22 and min(tilts) < -0.22
    truth = ticks(lab, 100, person)
    assert truth.state[0, :3] == pytest.approx(start[:3], abs=0.02)


# --- cables ------------------------------------------------------------------------------------

CABLES = [name for name, kind in FAULTS.items() if kind.PLACE == CABLE and "pull" in vars(kind)]


@pytest.mark.parametrize("name", CABLES)
def test_each_cable_is_pulled_and_plugged_in_again(laboratory, name):
    lab = laboratory()
    at = {"fault": name, "at": 1.0, "duration": 2.0}
    lab.timeline = Timeline(Schedule((timed(at, {}, "test"),)))
    lab.timeline.mission_at(0.0, 0.0, "take-off")
    assert lab.pull_cables(0.5) == []
    lab.mocap.expose(NOW, {"uam": (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))})

    def seen():
        line = lab.bus.line
        return (
            *(lab.parameters.places / device in lab.parameters.places.iterdir() for device in PTYS),
            *([one.connected for one in line.servos], line.bit_error_rate),
            *(lab.cable.cut, lab.cable.bit_error_rate, lab.magnet_plugged, lab.hil_plugged),
            *(lab.imu_plugged, [one.temperature for one in lab.servos]),
            *([one.alert for one in lab.servos], lab.mocap.state),
        )

    whole = seen()
    assert [one.fault.NAME for one in lab.pull_cables(1.5)] == [name]
    assert seen() != whole
    lab.pull_cables(4.0)
    if name == "servo_overload":  # only a reboot clears it
        lab.servos[0].restart()
    assert seen() == whole


PTYS = ("ttyARM", "ttyTELEM2", "ttyAUTOPILOT")


def test_a_hot_servo_stops_at_its_limit(laboratory):
    lab = laboratory()
    fault = {"fault": "servo_overheating", "at": 0.0, "rate": 1000.0}
    lab.timeline = Timeline(Schedule((timed(fault, {}, "test"),)))
    lab.timeline.mission_at(0.0, 0.0, "take-off")
    servo = lab.servos[0]
    servo.set("Torque Enable", 1)
    for tick in range(100):
        lab.pull_cables(tick * PERIOD)
    assert servo.temperature == 95.0
    servo.read(0, 1)  # the sensor is read: hotter than 80 degrees is an error
    assert servo.alert and servo.get("Torque Enable") == 0


def test_a_file_of_the_matrix_has_promises_for_all_flights():
    from uam_lab.experiments.faults import matrix as fault_matrix
    from uam_lab.experiments.trials.outcome import REFUSED

    matrix = fault_matrix.read(Path("config/campaign/cables.yaml"), "rehearsal")
    cells = matrix.cells(1)[1:]
    assert len(cells) == 48 and all(cell.promise for cell in cells)
    for cell in cells:
        (one,) = cell.schedule.faults
        assert one.fault.PLACE == CABLE
        assert (cell.moment == "start") == (cell.promise.outcomes == (REFUSED,))


def test_a_start_refused_at_any_moment_is_never_called_an_interrupt(monkeypatch):
    starter = SimpleNamespace(started=False, refused="", waits_for="the lists")
    course, said = RehearsalCourse.__new__(RehearsalCourse), []

    def look(_):
        """The start is refused while the vehicle's messages are read."""
        starter.waits_for = starter.refused = "open: clear"
        return True

    monkeypatch.setattr(VehicleCourse, "goes_on", look)
    course._starter, course._said, course._say_at = starter, "", 0.0
    course.flight = SimpleNamespace(observer=SimpleNamespace(message=said.append))
    course.children = SimpleNamespace(running=lambda name: True)
    assert not course.goes_on()
    assert course.refused == "open: clear" and said == ["before the start: open: clear"]
