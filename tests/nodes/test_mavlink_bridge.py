"""The bridge node over real ROS and real UDP, with the autopilot's objects on the other end."""

import math
import os
import socket
import time
import tty

import numpy as np
import pytest
from quadrotor import MASS, Quadrotor
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from uam_control.rotations import euler_from_quaternion, quaternion_from_euler
from uam_msgs_py import topics
from uam_msgs_py.control import ATTITUDE_NAMES, PositionCommandWriter, TorqueWriter
from uam_msgs_py.convert import PoseWriter, Serialized, TrajectoryWriter, read_setpoint
from uam_msgs_py.status import AutopilotState, MissionStatus
from uam_sim_bridge.autopilot.companion import Companion
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.modes import Mode
from uam_sim_bridge.mavlink.frames import swap_body
from uam_sim_bridge.mavlink.signing import Signing
from uam_sim_bridge.mavlink.wire import Codec, Framer, mavlink2

MODULE = "uam_sim_bridge.nodes.mavlink_bridge"
PERIOD = 4_000_000
NAMES = ["x", "y", "z", "roll", "pitch", "yaw", "alpha_1", "alpha_2"]
WEIGHT = MASS * 9.81


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Rig:
    """Plant, estimator and controllers as seen by the bridge, tick by tick."""

    def __init__(self, probe, start, *arguments):
        self.local, self.remote = free_port(), free_port()
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", self.remote))
        self.socket.setblocking(False)
        self.codec = Codec(1, 1)
        self.framer = Framer(self.codec)
        self.autopilot = Autopilot()
        self.companion = Companion(self.autopilot)
        self.received = []
        self.body = Quadrotor()
        self.probe, self.count = probe, 0
        self.setpoints = probe.collect(topics.SETPOINT)
        self.states = probe.collect(topics.AUTOPILOT_STATE)
        self.out = {
            t.name: probe.publisher(t)
            for t in (
                topics.STATE,
                topics.POSITION_COMMAND,
                topics.ATTITUDE_COMMAND,
                topics.MOCAP,
                topics.ARMING,
            )
        }
        self.node = start(
            MODULE,
            "--ros-args",
            "-p",
            f"local_port:={self.local}",
            "-p",
            f"autopilot_port:={self.remote}",
            *(a.format(local=self.local, remote=self.remote) for a in arguments),
        )
        self.state, self.pose = TrajectoryWriter(NAMES), PoseWriter()
        self.position, self.torque = PositionCommandWriter(), TorqueWriter(ATTITUDE_NAMES)
        hears = (topics.SETPOINT, topics.AUTOPILOT_STATE)
        probe.until_connected("mavlink_bridge", self.out.values(), hears)

    def publish(self, topic, message):
        self.out[topic.name].publish(message)

    def inputs(self, tau_p=None, tau_q=None):
        """Publish one tick's inputs; without tau_p idle ones."""
        stamp, body = self.count * PERIOD, self.body
        chi = np.zeros((3, 8))
        chi[0, :3], chi[0, 3:6] = body.position, euler_from_quaternion(body.quaternion)
        chi[1, :3], chi[1, 3:6] = body.velocity, body.gyro
        if self.count % 2 == 0:
            self.publish(topics.MOCAP, self.pose.fill(stamp, body.position, body.quaternion))
        self.publish(topics.STATE, self.state.fill(stamp, chi))
        if tau_p is None:
            self.publish(topics.POSITION_COMMAND, self.position.idle(stamp))
            self.publish(topics.ATTITUDE_COMMAND, self.torque.idle(stamp))
        else:
            self.publish(
                topics.POSITION_COMMAND,
                self.position.fill(stamp, chi, np.zeros((3, 3)), np.array(tau_p, float)),
            )
            self.publish(
                topics.ATTITUDE_COMMAND,
                self.torque.fill(stamp, np.array(tau_q or (0, 0, 0), float)),
            )

    def hear(self):
        """Let the autopilot take what has arrived; return the messages."""
        arrived = []
        while True:
            try:
                data = self.socket.recv(65535)
            except BlockingIOError:
                break
            arrived += self.framer.datagram(data)
        for message in arrived:
            self.companion.handle(self.body.time, message)
        self.received += arrived
        return arrived

    def tick(self, tau_p=None, tau_q=None):
        """One lockstep tick; return the acknowledged setpoint (rates, thrust)."""
        self.inputs(tau_p, tau_q)
        before, stamp = len(self.setpoints), self.count * PERIOD
        self.probe.until(lambda: len(self.setpoints) > before, "an acknowledged tick")
        found, rates, thrust = read_setpoint(self.setpoints[-1])
        assert found == stamp
        self.autopilot_tick()
        self.count += 1
        return rates, thrust

    def autopilot_tick(self):
        self.hear()
        body = self.body
        motors = self.autopilot.update(body.time, swap_body(body.gyro), swap_body(body.accel))
        for message in self.companion.tick(body.time):
            self.socket.sendto(self.codec.encode(message), ("127.0.0.1", self.local))
        body.step(motors)

    def fly(self):
        """Arm, put the vehicle up and let it hover."""
        self.publish(topics.ARMING, Bool(data=True))
        for _ in range(500):
            self.tick()
            if self.autopilot.status.armed:
                break
        assert self.autopilot.status.armed, self.node.output
        self.body.position[2] = 5.0
        self.body.hover()
        for _ in range(100):
            self.tick((0, 0, WEIGHT))

    def kinds(self):
        return {m.get_type() for m in self.received}


@pytest.fixture
def make_rig(probe, start):
    rigs = []

    def make(*arguments):
        rigs.append(Rig(probe, start, *arguments))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.socket.close()


def test_alone_it_waits_and_stops(start):
    node = start(MODULE, "--ros-args", "-p", f"local_port:={free_port()}")
    node.until_said(
        "waiting for /vrpn_mocap/uam/pose, /uam/state, /uam/position/command, /uam/attitude/command"
    )
    assert node.interrupt(times=3) == 0
    assert "Traceback" not in node.output


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["-p", "rate_p:=[0.0, 0.1, 0.1]"], "rate_p"),
        (["-p", "clock:=sundial"], "clock: 'sundial' is not one of"),
        (["-p", "local_port:=99999"], "local_port"),
        (["-p", "autopilot:=pigeon"], "allowed: udp:HOST:PORT"),
        (["-p", "autopilot:=serial:/dev/nothing:57600"], "No such file"),
        (["-p", "autopilot:=14550"], "autopilot: a text expected"),
        (["-p", "autopilot:=udp:127.0.0.1:9", "-p", "gcs:=tcp:localhost:5760"], "udp:HOST:PORT"),
        (["-p", "signing_key:=no/such/file"], "signing key: not 64 hex digits"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(start, arguments, complaint):
    node = start(MODULE, "--ros-args", *arguments)
    assert node.process.wait(60) == 2
    said = [line for line in node.output.splitlines() if line.startswith("mavlink_bridge: ")]
    assert len(said) == 1 and complaint in said[0] and "Traceback" not in node.output


def test_taken_port_is_said(start):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
        node = start(MODULE, "--ros-args", "-p", f"local_port:={port}")
        assert node.process.wait(60) == 2
    assert f"UDP port {port}" in node.output and "Traceback" not in node.output


def test_from_the_ground_to_hover_and_back(make_rig):
    rig = make_rig()
    rates, thrust = rig.tick()
    assert np.all(rates == 0.0) and thrust == 0.0
    rig.fly()
    states = [AutopilotState.from_message(m)[1] for m in rig.states]
    assert not states[0].armed and states[-1].armed and states[-1].mode == "OFFBOARD"
    since = states[-1].armed_since
    assert since % PERIOD == 0 and 1.0e9 < since < 2.5e9
    rates, thrust = rig.tick((0, 0, WEIGHT), (0.1, 0.0, 0.0))
    assert thrust == pytest.approx(WEIGHT / 41.36, rel=1e-6)
    assert rates == pytest.approx([0.1 / (5.00105 * 0.15), 0, 0], rel=1e-3, abs=1e-9)
    sent = [m for m in rig.received if m.get_type() == "SET_ATTITUDE_TARGET"][-1]
    assert sent.type_mask == 128
    assert (sent.body_roll_rate, sent.body_pitch_rate) == pytest.approx((rates[0], 0.0), rel=1e-5)
    assert sent.thrust == pytest.approx(thrust)
    assert {"HEARTBEAT", "VISION_POSITION_ESTIMATE", "COMMAND_LONG", "PARAM_REQUEST_READ"} <= (
        rig.kinds()
    )
    # landed: idle commands, then disarm
    rig.body.position[2] = 0.0
    rig.body.velocity[:] = rig.body.gyro[:] = 0.0
    for _ in range(400):
        rig.tick()
    rig.publish(topics.ARMING, Bool(data=False))
    for _ in range(300):
        rig.tick()
        if not rig.autopilot.status.armed:
            break
    assert not rig.autopilot.status.armed


def test_mapping_parameters_of_the_autopilot_are_compared(make_rig):
    rig = make_rig()
    rig.autopilot.set_parameter("MC_ROLLRATE_P", 0.3)
    for _ in range(100):
        rig.tick()
    rig.node.until_said("MC_ROLLRATE_P is 0.3 on the autopilot, the bridge assumes 0.15")


def test_bad_commands_in_flight_hold_level_then_the_failsafe_acts(make_rig):
    rig = make_rig("-p", "hold_braking:=0.0")
    rig.fly()
    thrusts = []
    for _ in range(200):
        rates, thrust = rig.tick((0, 0, math.nan))
        thrusts.append(thrust)
        assert np.all(np.isfinite(rates)) and np.all(np.abs(rates) <= 2.0)
    assert thrusts == pytest.approx([WEIGHT / 41.36] * 200, rel=0.02)
    assert rig.autopilot.status.mode is Mode.OFFBOARD
    for _ in range(650):
        rig.tick((0, 0, math.nan))
    assert rig.autopilot.status.mode is Mode.LAND  # COM_OF_LOSS_T after the hold
    assert rig.autopilot.status.armed
    assert "holding level" in rig.node.output
    # good commands again: the bridge asks for OFFBOARD again
    for _ in range(400):
        rig.tick((0, 0, WEIGHT))
    assert rig.autopilot.status.mode is Mode.OFFBOARD


def test_the_thrust_factor_is_identified_told_and_held_while_the_magnet_is_on(make_rig, probe):
    """The vehicle hovers with the thrust of its weight; the bridge believes it is lighter."""
    status = probe.publisher(topics.MISSION_STATUS)
    told = probe.collect(topics.THRUST)
    rig = make_rig("-p", "identification_mass:=1.9", "-p", "factor_slew:=0.5")
    probe.until_connected("mavlink_bridge", [status], [topics.THRUST])

    def factor():
        return Serialized(JointState, told[-1]).numbers("position")[0]

    rig.fly()
    assert factor() == 1.0
    for _ in range(300):
        _, thrust = rig.tick((0, 0, WEIGHT))
    assert 0.86 < factor() < 0.97
    assert thrust * 41.36 == pytest.approx(WEIGHT / factor(), rel=0.01)  # it is applied
    stamp = (rig.count - 1) * PERIOD
    status.publish(MissionStatus("carry", 1.0, magnet=True).to_message(stamp))
    time.sleep(0.2)  # it is not part of the join; let it arrive
    for _ in range(30):
        rig.tick((0, 0, WEIGHT))
    held = factor()
    for _ in range(100):
        rig.tick((0, 0, WEIGHT))
    assert factor() == held


def test_a_mission_in_failsafe_is_left_to_the_autopilot_down_to_the_ground(make_rig, probe):
    """Level, then no stream, and no wish for OFFBOARD, at any height; idle does not mean thrust
    0."""
    status = probe.publisher(topics.MISSION_STATUS)
    rig = make_rig()
    probe.until_connected("mavlink_bridge", [status], [])
    rig.fly()
    told = MissionStatus("aborted", 1.0, state="failsafe", cause="tilt").to_message(1)
    status.publish(told)
    time.sleep(0.2)  # it is not part of the join; let it arrive
    for _ in range(100):
        _, thrust = rig.tick()
        assert thrust == pytest.approx(WEIGHT / 41.36, rel=0.02)
    for _ in range(500):
        rig.tick()
    assert rig.autopilot.status.mode is Mode.LAND
    rig.body.position[2] = 0.2
    rig.received.clear()
    for _ in range(200):
        rig.tick()
    assert rig.autopilot.status.mode is Mode.LAND
    assert not rig.kinds() & {"SET_ATTITUDE_TARGET", "COMMAND_LONG"}


def test_idle_high_up_is_not_thrust_zero(make_rig):
    rig = make_rig("-p", "hold_braking:=0.0")
    rig.fly()
    _, thrust = rig.tick()
    assert thrust == pytest.approx(WEIGHT / 41.36, rel=0.02)


def test_garbage_from_the_autopilots_port_does_no_harm(make_rig):
    rig = make_rig()
    noise = np.random.default_rng(2)
    for _ in range(50):
        rig.socket.sendto(noise.bytes(int(noise.integers(1, 400))), ("127.0.0.1", rig.local))
        rig.tick()
    assert rig.node.process.poll() is None


def test_states_without_commands_hold_level_then_the_failsafe_acts(make_rig):
    """A controller is lost: states go on, by whose stamps the bridge counts."""
    rig = make_rig()
    rig.fly()
    stopped, thrusts, rolls = rig.count, [], []
    tilted = np.zeros((3, 8))
    tilted[0, 3] = 0.1  # roll [rad], which no command has seen
    for _ in range(950):
        rig.publish(topics.STATE, rig.state.fill(rig.count * PERIOD, tilted))
        silent = rig.count - stopped < 24  # stale_after, 0.1 s, after the last command
        before = len(rig.setpoints)
        if not silent:
            rig.probe.until(lambda n=before: len(rig.setpoints) > n, "a setpoint without command")
            _, rates, thrust = read_setpoint(rig.setpoints[-1])
            thrusts.append(thrust)
            rolls.append(rates[0])
        rig.autopilot_tick()
        rig.count += 1
    assert thrusts[:480] == pytest.approx([WEIGHT / 41.36] * 480, rel=0.02)
    expected = -0.1 * (6.0 + 6.0 * 0.004 * np.arange(480))  # hold_gain, hold_integral
    assert rolls[:480] == pytest.approx(expected, rel=0.03)
    assert thrusts[-1] == 0.0 and "stream stopped" in rig.node.output
    assert rig.autopilot.status.mode is Mode.LAND and rig.autopilot.status.armed
    for _ in range(400):
        rig.tick((0, 0, WEIGHT))
    assert rig.autopilot.status.mode is Mode.OFFBOARD


def test_realtime_watchdog_holds_level_and_then_stops(make_rig):
    """Ticks stop in flight: level setpoints go on by themselves for release_time, then none."""
    rig = make_rig("-p", "clock:=realtime", "-p", "stale_after:=2.0", "-p", "release_time:=1.0")
    rig.fly()
    rig.hear()
    rig.received.clear()

    def stream():
        rig.hear()
        return [m for m in rig.received if m.get_type() == "SET_ATTITUDE_TARGET"]

    rig.probe.until(lambda: len(stream()) >= 5, "setpoints of the watchdog")
    assert stream()[-1].thrust == pytest.approx(WEIGHT / 41.36, rel=0.05)
    rig.node.until_said("stream stopped")
    rig.hear()
    rig.received.clear()
    rig.probe.until(lambda: (rig.hear(), "HEARTBEAT" in rig.kinds())[1], "a heartbeat")
    assert stream() == []


def test_without_states_it_levels_by_the_motion_capture(make_rig):
    """The estimator is lost: the last estimate of the attitude is old, the mocap's is not."""
    level = ("-p", "hold_gain:=3.0", "-p", "hold_integral:=0.0", "-p", "release_time:=3.0")
    rig = make_rig("-p", "clock:=realtime", "-p", "stale_after:=1.0", *level)
    rig.fly()
    pose, tilted = PoseWriter(), quaternion_from_euler(np.array([0.1, 0.0, 0.0]))
    rig.hear()
    rig.received.clear()

    def rolled():
        now = rig.count * PERIOD + round((time.monotonic() - begin) * 1e9)
        rig.publish(topics.MOCAP, pose.fill(now, np.zeros(3), tilted))
        rig.hear()
        sent = [m for m in rig.received if m.get_type() == "SET_ATTITUDE_TARGET"]
        return any(m.body_roll_rate == pytest.approx(-0.3, abs=1e-3) for m in sent)

    begin = time.monotonic()
    rig.probe.until(rolled, "rates against the tilt that the mocap shows")


def values(messages):
    """The newest values under /diagnostics."""
    return {v.key: v.value for v in messages[-1].status[0].values}


def test_link_by_url(make_rig):
    rig = make_rig("-p", "local_port:=1", "-p", "autopilot:=udp:localhost:{remote}:{local}")
    rig.fly()


class Line:
    """A pseudo-terminal in the place of the rig's socket."""

    def __init__(self):
        self.far, self.near = os.openpty()
        tty.setraw(self.near)
        os.set_blocking(self.far, False)
        self.device = os.ttyname(self.near)

    def recv(self, size):
        return os.read(self.far, size)

    def sendto(self, data, place):
        os.write(self.far, data)

    def close(self):
        os.close(self.far)
        os.close(self.near)


def test_serial_link_by_url(make_rig):
    line = Line()
    rig = make_rig("-p", f"autopilot:=serial:{line.device}:921600")
    rig.socket.close()
    rig.socket, rig.framer.datagram = line, rig.framer.stream
    rig.fly()


def test_a_ground_station_watches_and_may_speak(make_rig):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(60.0)
        rig = make_rig("-p", f"gcs:=udp:127.0.0.1:{station.getsockname()[1]}")
        rig.fly()
        framer, seen, noise = Framer(Codec(255, 190)), set(), np.random.default_rng(3)
        while not {"HEARTBEAT", "SYS_STATUS", "COMMAND_ACK"} <= seen:
            data, place = station.recvfrom(65535)
            seen |= {m.get_type() for m in framer.datagram(data)}
        rig.socket.sendto(b"\xfd unknown to us", ("127.0.0.1", rig.local))
        rig.tick((0, 0, WEIGHT))
        while data != b"\xfd unknown to us":
            data = station.recv(65535)
        # it pretends to be the autopilot, floods, and asks for something
        fake, own = Codec(1, 1), Codec(255, 190)
        disarmed = mavlink2.MAVLink_heartbeat_message(2, 12, 1, 0, 3, 3)
        for _ in range(200):
            station.sendto(fake.encode(disarmed), place)
            station.sendto(noise.bytes(1000), place)
            rates, thrust = rig.tick((0, 0, WEIGHT))
            assert thrust == pytest.approx(WEIGHT / 41.36, rel=1e-6)
        ask = mavlink2.MAVLink_param_request_read_message(1, 1, b"MAV_SYS_ID", -1)
        for _ in range(2000):
            station.sendto(own.encode(ask), place)
            rig.tick((0, 0, WEIGHT))
            if any(m.get_srcSystem() == 255 for m in rig.received):
                break
        assert any(
            m.get_srcSystem() == 255 and m.get_type() == "PARAM_REQUEST_READ" for m in rig.received
        )
        assert rig.autopilot.status.armed and rig.autopilot.status.mode is Mode.OFFBOARD
        states = [AutopilotState.from_message(m)[1] for m in rig.states]
        assert states[-1].armed and states[-1].mode == "OFFBOARD"


def test_signed_on_both_sides_and_nothing_else_is_taken(make_rig, tmp_path):
    key = "0f" * 32
    file = tmp_path / "key"
    file.write_text(key + "\n")
    rig = make_rig("-p", f"signing_key:={file}", "-p", "signing_link_id:=4")
    heard = rig.probe.collect(topics.DIAGNOSTICS)
    signing = Signing.from_text(key)
    unsigned = rig.codec
    rig.codec = Codec(1, 1, signing)
    rig.framer = Framer(Codec(1, 1, signing))
    rig.fly()
    assert all(m.get_signed() and m.get_link_id() == 4 for m in rig.received)
    rig.codec = unsigned
    for _ in range(50):
        rig.tick((0, 0, WEIGHT))

    def refused():
        mine = [m for m in heard if m.status[0].name == "mavlink_bridge"]
        return mine and int(values(mine)["refused"]) > 0

    rig.probe.until(refused, "refusals under /diagnostics")
    assert key not in rig.node.output


def test_mapping_parameters_of_the_autopilot_are_adopted(make_rig):
    rig = make_rig("-p", "autopilot_parameters:=adopt")
    rig.autopilot.set_parameter("THR_MDL_FAC", 0.3)
    rig.autopilot.set_parameter("MC_ROLLRATE_P", 0.3)
    rig.fly()
    rig.node.until_said("adopted from the autopilot: MC_ROLLRATE_P is 0.3")
    rates, _ = rig.tick((0, 0, WEIGHT), (0.1, 0.0, 0.0))
    assert rates == pytest.approx([0.1 / (5.00105 * 0.3), 0, 0], rel=1e-3, abs=1e-9)
    # never in flight
    rig.autopilot.set_parameter("MC_PITCHRATE_P", 0.3)
    rig.companion.handle(
        rig.body.time, mavlink2.MAVLink_param_request_read_message(1, 1, b"MC_PITCHRATE_P", -1)
    )
    for _ in range(20):
        rig.tick((0, 0, WEIGHT))
    rig.node.until_said("MC_PITCHRATE_P is 0.3 on the autopilot, the bridge assumes 0.15")
    gyro = rig.body.gyro.copy()
    rates, _ = rig.tick((0, 0, WEIGHT), (0.0, 0.1, 0.0))
    assert rates[1] - gyro[1] == pytest.approx(0.1 / (5.00105 * 0.15), rel=1e-3)


def test_battery_and_health_are_published(make_rig, probe):
    batteries = probe.collect(topics.AUTOPILOT_BATTERY)
    reports = probe.collect(topics.DIAGNOSTICS)
    rig = make_rig()
    for _ in range(700):
        rig.tick()
    assert len(batteries) >= 2 and not batteries[-1].present
    assert math.isnan(batteries[-1].voltage) and math.isnan(batteries[-1].percentage)
    rig.socket.sendto(
        rig.codec.encode(
            mavlink2.MAVLink_battery_status_message(
                0, 0, 1, 2500, [4000] * 4 + [65535] * 6, 500, 100, -1, 75
            )
        ),
        ("127.0.0.1", rig.local),
    )
    for _ in range(260):
        rig.tick()
    assert any(
        b.present
        and b.voltage == pytest.approx(16.0)
        and b.current == pytest.approx(-5.0)
        and b.percentage == pytest.approx(0.75)
        for b in batteries
    )

    def values():
        found = [s for m in reports for s in m.status if s.name == "mavlink_bridge"]
        return {pair.key: pair.value for pair in found[-1].values} if found else {}

    probe.until(lambda: values().get("estimator"), "flags of the estimator")
    assert "attitude" in values()["estimator"] and values()["round trip [ms]"]
    assert float(values()["messages [1/s]"]) > 20.0 and values()["messages lost"] == "0"
