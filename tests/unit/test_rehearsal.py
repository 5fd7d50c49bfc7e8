"""The laboratory of a rehearsal: its clock, its cameras, its person, its wiring and its cables."""

import math
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from uam_control.maths.rotations import quaternion_from_euler
from uam_control.vehicle import load_description
from uam_lab.rehearsal.engine import RehearsalCourse
from uam_sim_bridge.drivers.dynamixel.chain import hardware_file, load_chain
from uam_sim_bridge.drivers.mocap import calibration
from uam_sim_bridge.drivers.mocap.calibration import Calibration
from uam_sim_bridge.drivers.mocap.frame import BodyPose
from uam_sim_bridge.faults import CABLE, FAULTS, FaultError, Schedule
from uam_sim_bridge.faults.schedule import timed
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2
from uam_sim_bridge.paced_clock import CATCH_UP, LATEST, PacedClock
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.rehearsal.cables import Cables
from uam_sim_bridge.rehearsal.ground_station import ALTITUDE, LATITUDE, LONGITUDE, GroundStation
from uam_sim_bridge.rehearsal.hands import Grip, joint_torque, wrench
from uam_sim_bridge.rehearsal.hil_line import SILENT, STOPPED, HilLine
from uam_sim_bridge.rehearsal.laboratory import Devices, Laboratory
from uam_sim_bridge.rehearsal.person import MOTIONS, Person, eased
from uam_sim_bridge.rehearsal.tracked_room import RoomBody
from uam_sim_bridge.rehearsal.wiring_mistakes import mistaken_chain

VEHICLE = load_description()
CHAIN = load_chain(hardware_file("s500_lab"), VEHICLE)
PERIOD = 0.004
NOW = 1.8e9  # [s] of the host


class Clock:
    """A clock that the test sets."""

    def __init__(self, now=0.0):
        self.now = now

    def __call__(self):
        return self.now


def mistakes(name, **values):
    return Schedule((timed({"fault": name, "at": "start", **values}, {}, "test"),))


# --- the clock ---------------------------------------------------------------------------------


def test_ticks_are_due_one_period_apart_and_have_the_system_time():
    steady, system = Clock(5.0), Clock(1000.0)
    clock = PacedClock(PERIOD, steady, system)
    clock.begin()
    assert clock.host(0) == 1000.0 and clock.host(250) == pytest.approx(1001.0)
    clock.note(0)
    assert clock.left(1) == pytest.approx(PERIOD)
    steady.now += PERIOD
    assert clock.left(1) == 0.0


@given(st.floats(0.009, 2.0))
def test_after_a_stall_ticks_run_faster_until_they_are_on_time(stall):
    steady = Clock()
    clock = PacedClock(PERIOD, steady, Clock())
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


# --- person ------------------------------------------------------------------------------------


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_motion_goes_one_way_only(a, b):
    assert eased(0.0) == 0.0 and eased(1.0) == 1.0
    assert eased(min(a, b)) <= eased(max(a, b))


@pytest.mark.parametrize("step", MOTIONS)
def test_the_person_moves_slowly_and_comes_back(step):
    person, chi = Person(VEHICLE.joint_names, VEHICLE.stowed), np.zeros(8)
    time = 0.0
    while not person.wishes_to_confirm:  # the hands take it
        grip = person.update(time, "hands_on", chi)
        time += 0.02
    home = grip.pose.copy()
    assert home == pytest.approx([0.0, 0.0, 0.6, 0.0, 0.0, 0.0])
    poses = []
    while not person.wishes_to_confirm or person.done[-1] != step:
        poses.append(person.update(time, step, chi).pose.copy())
        time += 0.02
    poses = np.array(poses) - home
    for axis, value in MOTIONS[step]:
        far = poses[:, axis] / value
        assert far.max() == pytest.approx(1.0)
        assert np.sum(far > 0.999) * 0.02 >= 1.0  # held
    assert poses[-1] == pytest.approx(np.zeros(6), abs=1e-9)
    speed = np.abs(np.diff(poses, axis=0)) / 0.02
    assert speed[:, :3].max() < 0.7 and speed[:, 3:].max() < 1.0


def test_the_person_moves_one_joint_and_puts_the_vehicle_down():
    person, chi = Person(VEHICLE.joint_names, VEHICLE.stowed), np.zeros(8)
    chi[6:] = 0.1, 1.5
    time, seen = 0.0, []
    for step in ("hands_on", "joint:alpha_2", "clear"):
        while not person.done or person.done[-1] != step:
            grip = person.update(time, step, chi)
            time += 0.02
            if step == "joint:alpha_2" and grip.joints is not None:
                seen.append(grip.joints.copy())
    assert seen[0] == pytest.approx([0.1, 1.5], abs=1e-3)  # where it was, then folded
    assert np.max(seen, axis=0) == pytest.approx([0.1, math.pi / 2 + 0.3], abs=1e-3)
    assert grip.pose is None and grip.joints is None  # hands off
    assert person.done == ["hands_on", "joint:alpha_2", "clear"]
    assert person.update(time, "", chi).pose is None


def test_a_step_that_does_not_pass_is_done_again():
    person, chi, time = Person(VEHICLE.joint_names, VEHICLE.stowed), np.zeros(8), 0.0
    while len(person.done) < 3:
        person.update(time, "lift", chi)
        time += 0.02
        assert time < 60.0
    assert person.done == ["lift"] * 3


def test_hands_pull_towards_the_grip_and_carry_the_weight():
    state = np.zeros((3, 8))
    force, torque = wrench(Grip(np.array([0.1, 0.0, 0.0, 0.2, 0.0, 0.0])), state, 20.0)
    assert force == pytest.approx([40.0, 0.0, 20.0]) and torque[0] > 0.0
    assert torque[1:] == pytest.approx([0.0, 0.0])
    assert joint_torque(Grip(joints=np.array([0.1, -9.0])), state) == pytest.approx([0.4, -2.0])
    assert wrench(Grip(), state, 20.0)[0] == pytest.approx(np.zeros(3))
    assert joint_torque(Grip(), state) == pytest.approx(np.zeros(2))


# --- the laboratory as a whole, without pace ---------------------------------------------------


@pytest.fixture
def laboratory(tmp_path, free_ports):
    made = []

    def make(*wiring, magnet=True, **output):
        devices = Devices(
            folder=tmp_path,
            chain=CHAIN,
            baud=921600,
            body="uam",
            payload="",
            calibration=calibration.load("motive_y_up"),
            mocap_port=0,
            magnet_line=tmp_path / "line" if magnet else None,
            **output,
        )
        schedule = Schedule(tuple(one for s in wiring for one in s.faults))
        made.append(Laboratory(Vehicle.of(VEHICLE), devices, free_ports(), 0.2, 1, (), schedule))
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
        lab.devices.magnet_line.write_text(content)
        lab.magnet_plugged = plugged
        ticks(lab, 1)
        assert lab.magnet is expected
    lab.devices.magnet_line.unlink()
    lab.magnet_plugged = True
    ticks(lab, 1)
    assert lab.magnet is False


def test_an_inverted_magnet_and_one_of_the_autopilot(laboratory):
    lab = laboratory(mistakes("magnet_inverted"))
    lab.devices.magnet_line.write_text("0")
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


# --- an autopilot in HITL on a line of its own ------------------------------------------------


class Px4:
    """What PX4 does on its USB line: opens the device, sends messages, reads those that come."""

    def __init__(self, path):
        self.port = serial.Serial(str(path), 921600, timeout=0)
        self._codec = Codec(1, 1)
        self._framer = Framer(self._codec)

    def send(self, *messages):
        for message in messages:
            self.port.write(self._codec.encode(message))

    def read(self):
        return self._framer.stream(self.port.read(65536))


HEARTBEAT = mavlink2.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3)


def motors(*values, armed=True, magnet=0.0):
    controls = [*values, *[0.0] * (10 - len(values)), magnet, *[0.0] * 5]
    return mavlink2.MAVLink_hil_actuator_controls_message(5, controls, 128 if armed else 0, 0)


def until(condition):
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


@pytest.fixture
def line(tmp_path):
    clock = Clock(100.0)
    made = HilLine(tmp_path / "ttyUSB", 4, 1, clock)
    yield made, clock
    made.close()
    assert not (tmp_path / "ttyUSB").exists()


def test_sensors_go_to_the_autopilot_and_motors_come_back_over_the_line(line):
    hil, clock = line
    assert not hil.connected and not hil.accept(0.0)
    px4 = Px4(hil.path)
    px4.send(HEARTBEAT)
    until(lambda: hil.accept(0.1))
    body = np.zeros(3), np.array([0.0, 0.0, 9.81]), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    hil.send(0.004, *body)
    seen = []
    until(lambda: (seen.extend(px4.read()), "HIL_SENSOR" in {m.get_type() for m in seen})[1])
    sensor = next(m for m in seen if m.get_type() == "HIL_SENSOR")
    assert (sensor.time_usec, sensor.get_srcSystem()) == (4000, 1)
    assert sensor.zacc == pytest.approx(-9.81)
    # the ground station is on the same line, with an id of its own
    kinds = {m.get_type(): m.get_srcSystem() for m in seen}
    station = {"HEARTBEAT": 255, "MANUAL_CONTROL": 255, "SET_GPS_GLOBAL_ORIGIN": 255}
    assert kinds == station | {"HIL_SENSOR": 1}
    px4.send(motors(0.1, 0.2, 0.3, 0.4, magnet=1.0))
    until(lambda: hil.receive(0.0).any())
    assert hil.motors == pytest.approx([0.1, 0.2, 0.3, 0.4]) and hil.armed
    assert hil.controls[10] == 1.0
    px4.port.close()


def test_motors_stop_when_the_autopilot_is_silent(line):
    hil, clock = line
    px4 = Px4(hil.path)
    px4.send(motors(0.5, 0.5, 0.5, 0.5))
    until(lambda: hil.receive().any())
    clock.now += 0.9 * STOPPED
    assert hil.receive().all()
    clock.now += 0.2 * STOPPED
    assert not hil.receive().any() and not hil.armed and hil.connected
    clock.now += SILENT
    assert not hil.connected
    px4.port.close()


def test_the_ground_station_asks_for_the_origin_until_it_is_there():
    station, kinds = GroundStation(), []
    for k in range(100):
        kinds += [message.get_type() for message in station.due(0.0501 * k)]
    assert kinds.count("MANUAL_CONTROL") == 100 and kinds.count("HEARTBEAT") == 5
    assert kinds.count("SET_GPS_GLOBAL_ORIGIN") == 3
    # PX4 keeps latitude and longitude alone while its height is not valid
    station.take(mavlink2.MAVLink_gps_global_origin_message(LATITUDE, LONGITUDE, 0))
    assert not station.origin_known
    again = [message.get_type() for message in station.due(30.0)]
    assert "SET_GPS_GLOBAL_ORIGIN" in again
    station.take(mavlink2.MAVLink_gps_global_origin_message(LATITUDE - 1, LONGITUDE, ALTITUDE))
    assert station.origin_known
    later = [message.get_type() for message in station.due(60.0)]
    assert "SET_GPS_GLOBAL_ORIGIN" not in later and "HEARTBEAT" in later


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

CABLES = [name for name, kind in FAULTS.items() if kind.PLACE == CABLE and not kind.WIRING]


@pytest.mark.parametrize("name", CABLES)
def test_each_cable_is_pulled_and_plugged_in_again(laboratory, name):
    lab = laboratory()
    at = {"fault": name, "at": 1.0, "duration": 2.0}
    cables = Cables(lab, Schedule((timed(at, {}, "test"),)))
    cables.timeline.mission_at(0.0, 0.0, "take-off")
    assert cables.update(0.5) == []
    lab.mocap.expose(NOW, {"uam": (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))})

    def seen():
        line = lab.bus.line
        return (
            *(lab.devices.folder / device in lab.devices.folder.iterdir() for device in PTYS),
            *([one.connected for one in line.servos], line.faults.bit_error_rate),
            *(lab.cable.cut, lab.cable.bit_error_rate, lab.magnet_plugged, lab.hil_plugged),
            *(cables.imu_plugged, [one.temperature for one in lab.servos]),
            *([one.alert for one in lab.servos], lab.mocap.state),
        )

    whole = seen()
    assert [one.fault.NAME for one in cables.update(1.5)] == [name]
    assert seen() != whole
    cables.update(4.0)
    if name == "servo_overload":  # only a reboot clears it
        lab.servos[0].restart()
    assert seen() == whole


PTYS = ("ttyARM", "ttyTELEM2", "ttyAUTOPILOT")


def test_a_hot_servo_stops_at_its_limit(laboratory):
    lab = laboratory()
    fault = {"fault": "servo_overheating", "at": 0.0, "rate": 1000.0}
    cables = Cables(lab, Schedule((timed(fault, {}, "test"),)))
    cables.timeline.mission_at(0.0, 0.0, "take-off")
    servo = lab.servos[0]
    servo.set("Torque Enable", 1)
    for tick in range(100):
        cables.update(tick * PERIOD)
    assert servo.temperature == 95.0
    servo.read(0, 1)  # the sensor is read: hotter than 80 degrees is an error
    assert servo.alert and servo.get("Torque Enable") == 0


def test_a_file_of_the_matrix_has_thirty_flights():
    from uam_lab.campaign import fault_matrix
    from uam_lab.campaign.fault_outcome import REFUSED

    matrix = fault_matrix.read(Path("config/campaign/cables.yaml"), "rehearsal")
    cells = matrix.cells(1)[1:]
    assert len(cells) == 30 and all(cell.promise for cell in cells)
    for cell in cells:
        (one,) = cell.schedule.faults
        assert one.fault.PLACE == CABLE
        assert (cell.moment == "start") == (cell.promise.outcomes == (REFUSED,))


class RefusesMeanwhile:
    """A start that is refused while the vehicle's messages are read."""

    def __init__(self):
        self.started, self.refused, self.waits_for = False, "", "the lists"

    def vehicle_course(self, listener):
        return self

    def starter(self):
        return self

    def say(self, line):
        pass

    def running(self, name):
        return True

    def goes_on(self):
        self.waits_for = self.refused = "open: clear"
        return True


def test_a_start_refused_at_any_moment_is_never_called_an_interrupt():
    rehearsal = RefusesMeanwhile()
    stored = SimpleNamespace(
        vehicle_course=rehearsal.vehicle_course, starter=rehearsal.starter, say=rehearsal.say
    )
    course = RehearsalCourse(stored, rehearsal, None)
    assert not course.goes_on()
    assert stored.refused == "open: clear"
