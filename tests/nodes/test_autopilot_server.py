"""The autopilot as a process on real sockets: a rigid quadrotor, HIL link, offboard link."""

import random
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
from free_port import free_port
from quadrotor import MASS, Quadrotor

from uam_control.frames import swap_body
from uam_control.offboard.modes import Mode
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_control.setpoints.rate_thrust_map import RateThrustMap, RateThrustParameters
from uam_control.setpoints.targets import AttitudeTarget, VisionPose
from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot import server
from uam_sim_bridge.mavlink.hil.hil_server import HilServer
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Signing, mavlink2
from uam_sim_bridge.mavlink.transport.transport import UdpTransport
from uam_sim_bridge.ports import PortError

START_TIMEOUT = 60.0  # s: a first start compiles
PATIENT = 30.0, 10.0  # for a loaded machine
HOVER = MASS * 9.81


MODULE = "uam_sim_bridge.autopilot.server"


class Flight:
    """Quadrotor, HIL server, the autopilot's process and the bridge's link, in lockstep."""

    def __init__(self, start, signing=None, arguments=()):
        self.tcp, self.udp = free_port(), free_port()
        self.local = free_port()
        self.hil = HilServer(self.tcp, 4, waits=PATIENT)
        self.server = start(
            MODULE,
            "--once",
            "--sim-port",
            self.tcp,
            "--mavlink-port",
            self.udp,
            "--companion-port",
            self.local,
            *arguments,
        )
        self.sequence = OffboardSequence(OffboardParameters(return_after_lost_link=True))
        self.link = OffboardLink(
            UdpTransport(self.local, ("127.0.0.1", self.udp)),
            self.sequence,
            RateThrustParameters.of(load_description()),
            signing=signing,
        )
        self.body = Quadrotor()
        self.streaming = self.vision = True
        self.received = []
        self.ticks = 0
        self.armed_at = None  # [s]
        assert self.hil.accept(START_TIMEOUT)

    def tick(self, rates=(0, 0, 0), thrust=0.0):
        body, link = self.body, self.link
        self.ticks += 1
        link.poll(body.time)
        link.tick(body.time)
        self.received += self.sequence.reasons
        if self.armed_at is None and self.sequence.phase is Phase.FLYING:
            self.armed_at = body.time
        if self.vision and self.ticks % 5 == 0:
            link.send_vision(VisionPose(body.time, body.position, body.quaternion, 0.005, 0.02))
        if self.streaming and self.sequence.streaming:
            self.sequence.streamed(body.time)
            link.send_setpoint(
                AttitudeTarget.of_rates(swap_body(np.array(rates, float)), thrust), body.time
            )
        self.hil.send(body.time, body.gyro, body.accel, body.position, body.quaternion)
        motors = self.hil.receive()
        assert self.hil.answered
        body.step(motors)

    def run(self, seconds, rates=(0, 0, 0), thrust=0.0):
        for _ in range(round(seconds / 0.004)):
            self.tick(rates, thrust)

    def airborne(self, height=20.0):
        """Arm on the ground, place the vehicle in the air and let it hover."""
        self.sequence.set_desired(True)
        self.run(3.0)
        assert self.sequence.phase is Phase.FLYING, self.sequence.reasons
        self.body.position[2] = height
        self.body.hover()
        self.run(1.0, thrust=HOVER / 41.36)

    def close(self):
        """Close the links; return the exit status of the process."""
        self.hil.close()
        self.link.close()
        return self.server.process.wait(20.0)


@pytest.fixture
def flight(start):
    f = Flight(start)
    yield f
    f.close()


def test_arms_flies_and_tracks_rate_steps(flight):
    flight.airborne()
    assert flight.hil.armed and flight.link.mode is Mode.OFFBOARD
    assert 1.0 < flight.armed_at < 1.2
    # hover thrust from the map carries the weight
    _, thrust = RateThrustMap().map(np.array([0, 0, HOVER]), np.zeros(3), np.zeros(3), np.zeros(3))
    flight.run(1.0, thrust=thrust)
    assert flight.body.thrusts.sum() == pytest.approx(HOVER, rel=2e-3)
    # roll step of 1 rad/s (FLU): 10 - 90 % quickly, little overshoot, no coupling
    rates = []
    for _ in range(100):
        flight.tick((1.0, 0.0, 0.0), thrust)
        rates.append(flight.body.gyro.copy())
    rates = np.array(rates)
    assert np.argmax(rates[:, 0] > 0.9) * 0.004 < 0.2
    assert rates[:, 0].max() < 1.5
    assert rates[-20:, 0].mean() == pytest.approx(1.0, rel=0.15)
    assert np.abs(rates[:, 1:]).max() < 0.1
    # parameters of the mapping were read and agree
    assert flight.link.parameters.values["MC_ROLLRATE_P"] == pytest.approx(0.15)
    assert flight.link.warnings == ()


def test_same_flight_twice_is_the_same_to_the_bit(start):
    ends = []
    for _ in range(2):
        f = Flight(start)
        f.airborne()
        f.run(0.4, (0.5, -0.3, 0.2), 0.53)
        f.close()
        ends.append(np.concatenate([f.body.position, f.body.quaternion, f.body.thrusts]))
    assert np.array_equal(*ends)


def test_arming_is_refused_in_words(flight):
    flight.vision = False
    flight.sequence.set_desired(True)
    flight.run(2.5)
    assert flight.sequence.phase is Phase.ARMING and not flight.hil.armed
    assert any("vision" in reason for reason in flight.received)
    flight.vision = True
    flight.run(1.0)
    assert flight.sequence.phase is Phase.FLYING


def test_offboard_is_refused_without_a_stream(flight):
    flight.streaming = False
    flight.sequence.set_desired(True)
    flight.run(2.5)
    assert flight.sequence.phase is Phase.OFFBOARD and not flight.hil.armed
    assert any("no offboard signal" in reason for reason in flight.received)


def test_loss_of_the_stream_and_recovery(flight):
    flight.airborne()
    flight.streaming = False
    flight.run(0.4, thrust=0.5)
    assert flight.link.mode is Mode.OFFBOARD
    flight.run(0.3)
    assert flight.link.mode is Mode.LAND and flight.hil.armed  # descending
    flight.streaming = True
    flight.run(1.5, thrust=HOVER / 41.36)
    assert flight.link.mode is Mode.OFFBOARD and flight.sequence.phase is Phase.FLYING


def test_stream_lost_for_good_lands_and_disarms(flight):
    flight.airborne(2.0)
    flight.streaming = False
    flight.sequence.parameters = flight.sequence.parameters.__class__(recovery_attempts=0)
    for _ in range(4000):
        flight.tick()
        if not flight.hil.armed:
            break
    assert not flight.hil.armed and flight.body.position[2] == 0.0
    flight.run(0.5)
    assert flight.sequence.phase is Phase.FAILED


def test_garbage_and_truncated_bytes_are_survived(flight):
    flight.airborne()
    noise = random.Random(3)
    stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    good = flight.link.codec
    kill = good.encode(mavlink2.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0))
    for _ in range(200):
        flight.link.transport.send(noise.randbytes(noise.randrange(1, 300)))
        flight.link.transport.send(kill[: noise.randrange(1, len(kill))])
        stranger.sendto(kill, ("127.0.0.1", flight.udp))  # not the first peer
        flight.tick(thrust=HOVER / 41.36)
    assert flight.hil.armed and flight.link.mode is Mode.OFFBOARD
    flight.hil._link.setblocking(True)
    flight.hil._link.sendall(noise.randbytes(500) + bytes(300))
    flight.hil._link.setblocking(False)
    flight.run(0.2, thrust=HOVER / 41.36)
    assert flight.hil.armed
    stranger.close()


def test_signed_flight_and_no_answer_to_others(start):
    key = "ab" * 32
    f = Flight(start, Signing.from_text(key), ("--signing-key", key))
    f.airborne()
    assert f.link.codec.refused == 0
    other = f.link.codec
    f.link.codec = Codec(1, 191)  # no signature: the stream ends for the autopilot
    f.run(1.3, thrust=HOVER / 41.36)
    assert f.link.mode is Mode.LAND
    f.link.codec = other
    f.run(0.1)
    assert f.link.mode is Mode.LAND and f.hil.armed
    f.close()
    assert key not in f.server.output


def test_ends_with_the_simulator(flight):
    flight.run(0.2)
    assert flight.close() == 0
    said = flight.server.output.splitlines()
    assert all(line.startswith("autopilot: ") for line in said) and "closed the link" in said[-1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--wait", "0.2", "--sim-port", "1"], "no simulator at 127.0.0.1:1"),
        (["--params", "/nowhere.yaml"], "No such file"),
        (["--instance", "-1"], "instance number"),
        (["--sim-port", "70000"], "not a port"),
        (["--wait", "x"], "not a time"),
        (["--signing-key", "secret"], "not 64 hex digits"),
        (["--serial", "/dev/nothing:57600"], "does not exist"),
        (["--serial", "/dev/null"], "a device and"),
        (["--serial", "/dev/null:57600", "--signing-key", "ab" * 32], "not signed"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(arguments, message, capsys):
    own = signal.getsignal(signal.SIGTERM)
    try:
        status = server.main([*arguments, "--mavlink-port", str(free_port())])
    except SystemExit as ended:  # of the parser
        status = ended.code
    finally:
        signal.signal(signal.SIGTERM, own)
    assert status == 2
    assert message in capsys.readouterr().err.strip().splitlines()[-1]


def test_a_used_udp_port_is_a_one_line_error(start):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        refused = start(MODULE, "--once", "--mavlink-port", s.getsockname()[1], "--wait", "0.1")
        assert refused.process.wait(60.0) == 2
    (line,) = refused.output.splitlines()
    assert "UDP port" in line and "in use" in line


def test_sigterm_ends_it_quietly(start):
    ports = free_port(), free_port()
    waiting = start(MODULE, "--once", "--sim-port", ports[0], "--mavlink-port", ports[1])
    waiting.until_logged("waiting for the simulator")
    assert waiting.interrupt(number=signal.SIGTERM) == 0
    assert waiting.output.count("\n") == 1


def test_help_has_examples():
    command = [sys.executable, "-m", MODULE, "--help"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert "autopilot --instance 3" in done.stdout


class FakeAutopilot:
    """The TCP client's side, operated by the test."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=10)
        self.codec = Codec(1, 1)
        self.framer = Framer(self.codec)

    def sensors(self):
        return self.framer.stream(self.socket.recv(65536))

    def answer(self, microseconds, motors, mode):
        self.socket.sendall(
            self.codec.encode(
                mavlink2.MAVLink_hil_actuator_controls_message(
                    microseconds, [*motors, *[0.0] * 12], mode, 1
                )
            )
        )


@pytest.fixture
def pair():
    server = HilServer(0, 4, waits=(0.2, 0.01))
    fake = FakeAutopilot(server._listener.getsockname()[1])
    assert server.accept(5.0)
    yield server, fake
    fake.socket.close()
    server.close()


BODY = (
    np.array([0.1, 0.2, 0.3]),
    np.array([0.0, 0.0, 9.81]),
    np.zeros(3),
    np.array([1.0, 0.0, 0.0, 0.0]),
)


def test_sensor_message_is_frd_with_slow_sensors_at_50_hz(pair):
    server, fake = pair
    messages = []
    for k in range(25):
        server.send(0.004 * k, *BODY)
        messages += fake.sensors()
    assert len(messages) == 25
    first = messages[0]
    assert (first.xgyro, first.ygyro, first.zgyro) == pytest.approx((0.1, -0.2, -0.3))
    assert (first.xacc, first.yacc, first.zacc) == pytest.approx((0.0, 0.0, -9.81))
    assert first.id == 0
    slow = [k for k, m in enumerate(messages) if m.fields_updated == 0x3F | 0x1C0 | 0x1A00]
    assert slow == [0, 5, 10, 15, 20]
    assert all(m.fields_updated & 0x3F == 0x3F for m in messages)
    # nose east: the field's north part comes from the left
    assert first.ymag == pytest.approx(-0.215, abs=0.02)
    assert first.zmag == pytest.approx(0.425, abs=0.02)
    assert first.pressure_alt == pytest.approx(488.0, abs=1.0)
    assert len({m.xmag for m in messages}) == 5  # never constant


def test_motors_count_only_while_armed_and_finite(pair):
    server, fake = pair
    server.send(0.0, *BODY)
    fake.answer(0, [0.1, 0.2, 0.3, 1.4], 129)
    assert server.receive(1.0) == pytest.approx([0.1, 0.2, 0.3, 1.0]) and server.armed
    for k, (motors, mode) in enumerate(
        [([0.5] * 4, 1), ([0.5, float("nan"), 0.5, 0.5], 129)], start=1
    ):
        server.send(0.004 * k, *BODY)
        fake.answer(4000 * k, motors, mode)
        assert np.all(server.receive(1.0) == 0.0)


def test_waits_are_bounded_and_shorter_after_silence(pair):
    server, fake = pair
    server.send(0.0, *BODY)
    fake.answer(0, [0.5] * 4, 129)
    server.receive(1.0)
    begin = time.monotonic()
    server.send(0.004, *BODY)
    motors = server.receive()
    first = time.monotonic() - begin
    server.send(0.008, *BODY)
    server.receive()
    assert first >= 0.2 and not server.answered and server.missed == 2
    assert motors == pytest.approx([0.5] * 4)  # the last commands remain
    fake.answer(8000, [0.4] * 4, 129)
    server.send(0.012, *BODY)
    server.receive(0.05)
    assert not server.answered  # an answer to an older tick does not count
    assert server.motors == pytest.approx([0.4] * 4)


def test_hang_up_stops_the_motors(pair):
    server, fake = pair
    server.send(0.0, *BODY)
    fake.answer(0, [0.5] * 4, 129)
    server.receive(1.0)
    fake.socket.close()
    for k in range(3):
        server.send(0.004 * (k + 1), *BODY)
        server.receive()
    assert not server.connected and np.all(server.motors == 0.0) and not server.armed


def test_a_used_simulator_port_is_a_one_line_error():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as s:
        s.bind(("127.0.0.1", 0))
        s.listen()
        port = s.getsockname()[1]
        with pytest.raises(PortError, match=f"TCP port {port} .*in use") as error:
            HilServer(port, 4)
        assert "\n" not in str(error.value)
