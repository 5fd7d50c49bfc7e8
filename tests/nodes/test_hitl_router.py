"""The HITL router as a process, over pseudo-terminals: plant and bridge on one side, the autopilot
stand-in on the serial line on the other."""

import os
import random
import select
import socket
import threading
import time
import tty

import numpy as np
import pytest
from free_port import free_port
from quadrotor import Quadrotor

from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.setpoints.targets import AttitudeTarget, VisionPose
from uam_control.vehicle import load_description
from uam_sim_bridge.mavlink.hil.hil_server import HilServer
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2
from uam_sim_bridge.mavlink.transport.transport import UdpTransport

ROUTER, AUTOPILOT = "uam_sim_bridge.mavlink.hil.router", "uam_sim_bridge.autopilot.server"
PATIENCE = 60.0  # s for a process to start: the stand-in compiles
# the server waits this long only for a frame that invalid bytes have cut short
HIL = 2.0, 0.5
PATIENT = 30.0, 10.0


class Cable:
    """Two connected pseudo-terminals; `ends`: their device names. `cut` closes both."""

    def __init__(self):
        pairs = [os.openpty(), os.openpty()]
        for _, near in pairs:
            tty.setraw(near)
        self.ends = [os.ttyname(near) for _, near in pairs]
        self._far = [far for far, _ in pairs]
        self._near = [near for _, near in pairs]
        self._lock, self._cut = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._pump, daemon=True)
        self._thread.start()

    def _pump(self):
        while not self._cut.is_set():
            for source in select.select(self._far, [], [], 0.02)[0]:
                data = os.read(source, 4096)
                self.put(1 - self._far.index(source), data)

    def put(self, end, data):
        """Output bytes at one end."""
        with self._lock:
            os.write(self._far[end], data)

    def cut(self):
        if not self._cut.is_set():
            self._cut.set()
            self._thread.join(PATIENCE)
            for number in (*self._far, *self._near):
                os.close(number)


class Bench:
    """Plant, bridge's link, router and stand-in in one loop."""

    def __init__(self, start, *arguments, hil=HIL):
        self.cable = Cable()
        tcp, self.udp = free_port(), free_port()
        local = free_port()
        self.hil = HilServer(tcp, 4, waits=hil)
        self.autopilot = start(AUTOPILOT, "--serial", f"{self.cable.ends[1]}:921600")
        self.autopilot.until_logged("on the serial line")
        self.router = start(
            ROUTER,
            f"serial:{self.cable.ends[0]}:921600",
            "--sim-port",
            str(tcp),
            "--mavlink-port",
            str(self.udp),
            "--companion-port",
            str(local),
            *arguments,
        )
        self.sequence = OffboardSequence()
        self.link = OffboardLink(
            UdpTransport(local, ("127.0.0.1", self.udp)),
            self.sequence,
            RateThrustParameters.of(load_description()),
        )
        self.body = Quadrotor()
        self.ticks = self.answered = 0
        self._began = time.monotonic()
        assert self.hil.accept(PATIENCE), self.router.output
        self.router.until_logged("connected to the simulator")

    def tick(self, thrust=0.0):
        body, link = self.body, self.link
        # not faster than a simulator does: the line carries so many messages a second
        time.sleep(max(0.0, self._began + body.time - time.monotonic()))
        self.ticks += 1
        link.poll(body.time)
        link.tick(body.time)
        if self.ticks % 5 == 0:
            link.send_vision(VisionPose(body.time, body.position, body.quaternion, 0.005, 0.02))
        if self.sequence.streaming:
            link.send_setpoint(AttitudeTarget.of_rates(np.zeros(3), thrust), body.time)
        self.hil.send(body.time, body.gyro, body.accel, body.position, body.quaternion)
        motors = self.hil.receive()
        self.answered += self.hil.answered
        body.step(motors)

    def until(self, condition, what, thrust=0.0):
        """Tick until the condition is true."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, f"{what}: not within {PATIENCE:g} s\n" + (
                self.router.output + self.autopilot.output
            )
            self.tick(thrust)

    def arm(self):
        self.until(lambda: self.answered > 20, "answers")
        self.sequence.set_desired(True)
        self.until(lambda: self.sequence.phase is Phase.FLYING, "armed and in OFFBOARD")
        self.until(lambda: self.hil.armed and self.hil.motors.max() > 0.1, "turning motors", 0.3)

    def close(self):
        self.hil.close()
        self.link.close()
        self.cable.cut()


@pytest.fixture
def bench(start):
    benches = []

    def make(*arguments, **options):
        benches.append(Bench(start, *arguments, **options))
        return benches[-1]

    yield make
    for b in benches:
        b.close()


def test_arms_over_the_line_and_ends_with_the_simulator(bench):
    b = bench()
    b.arm()
    assert b.link.mode is Mode.OFFBOARD and b.link.parameters.values[
        "MC_ROLLRATE_P"
    ] == pytest.approx(0.15)
    b.hil.close()
    assert b.router.process.wait(PATIENCE) == 0
    assert "the simulator closed the link" in b.router.output
    assert "Traceback" not in b.router.output + b.autopilot.output
    b.cable.cut()
    assert b.autopilot.process.wait(PATIENCE) == 0
    assert "the serial line is gone" in b.autopilot.output


def test_invalid_bytes_on_the_line_do_not_end_the_exchange(bench):
    b = bench()
    b.arm()
    noise = random.Random(7)
    for _ in range(10):
        for end in (0, 1):
            b.cable.put(end, noise.randbytes(noise.randrange(1, 200)))
        before = b.answered
        b.until(lambda: b.answered >= before + 5, "answers after garbage", 0.3)  # noqa: B023
    assert b.router.process.poll() is None and b.autopilot.process.poll() is None


def test_a_cut_line_stops_the_motors_and_both_ends_report_it(bench):
    b = bench()
    b.arm()
    b.cable.cut()
    b.router.until_logged("lost: motor commands are zero")
    b.until(lambda: not b.hil.armed, "motors at rest")
    assert np.all(b.hil.motors == 0.0) and b.hil.connected
    assert b.autopilot.process.wait(PATIENCE) == 0
    assert b.router.interrupt() == 0 and "Traceback" not in b.router.output


def test_dropped_sensors_are_answered_with_the_newest_commands(bench):
    b = bench("--hil-rate", "50", hil=PATIENT)
    b.until(lambda: b.answered > 100, "answers")
    assert b.hil.missed == 0


class Wires:
    """A router between plain sockets and a flight controller that the test plays."""

    def __init__(self, start, device, *arguments, baud=921600):
        self.device = device
        self.plug()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.udp, port = free_port(), self.listener.getsockname()[1]
        self.bridge = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.bridge.bind(("127.0.0.1", 0))
        self.bridge.settimeout(PATIENCE)
        self.router = start(
            ROUTER,
            f"serial:{device}:{baud}",
            "--sim-port",
            str(port),
            "--mavlink-port",
            str(self.udp),
            "--companion-port",
            str(self.bridge.getsockname()[1]),
            *arguments,
        )
        self.listener.settimeout(PATIENCE)
        self.plant, _ = self.listener.accept()
        self.plant.settimeout(PATIENCE)
        self.codec, self.received, self.framer = Codec(1, 200), [], Framer(Codec(9, 9))

    def plug(self):
        self.far, self.near = os.openpty()
        tty.setraw(self.near)
        os.set_blocking(self.far, False)
        self.device.symlink_to(os.ttyname(self.near))

    def unplug(self):
        self.device.unlink()
        os.close(self.far)
        os.close(self.near)

    def read(self):
        """Return all messages received from the line so far."""
        try:
            self.received += self.framer.stream(os.read(self.far, 65536))
        except BlockingIOError:
            time.sleep(0.001)
        return self.received

    def until(self, condition):
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, self.router.output
        return True

    def send(self, *messages):
        for message in messages:
            os.write(self.far, self.codec.encode(message))

    def close(self):
        for thing in (self.plant, self.listener, self.bridge):
            thing.close()
        self.unplug()


@pytest.fixture
def wires(start, tmp_path):
    made = []

    def make(*arguments, **options):
        made.append(Wires(start, tmp_path / "ttyACM0", *arguments, **options))
        return made[-1]

    yield make
    for w in made:
        w.close()


def sensor(microseconds):
    return mavlink2.MAVLink_hil_sensor_message(microseconds, *[0.1] * 13, 0x1FFF, 0)


def controls(microseconds, mode=129):
    return mavlink2.MAVLink_hil_actuator_controls_message(microseconds, [0.5] * 16, mode, 0)


def test_commands_go_to_the_plant_with_its_time_and_the_rest_to_the_bridge(wires):
    w = wires()
    heartbeat = mavlink2.MAVLink_heartbeat_message(2, 12, 0x81, 6 << 16, 4, 3)
    w.plant.sendall(w.codec.encode(sensor(8_000)))
    w.until(lambda: [m for m in w.read() if m.get_type() == "HIL_SENSOR"])
    w.send(heartbeat, controls(77_000_000))
    frame = w.bridge.recv(500)
    assert Framer(Codec(9, 9)).datagram(frame)[0].custom_mode == 6 << 16
    answer = Framer(Codec(9, 9)).stream(w.plant.recv(500))[0]
    assert answer.time_usec == 8_000 and answer.mode == 129 and answer.controls[0] == 0.5
    request = w.codec.encode(mavlink2.MAVLink_param_request_list_message(1, 1))
    w.bridge.sendto(request, ("127.0.0.1", w.udp))
    w.until(lambda: [m for m in w.read() if m.get_type() == "PARAM_REQUEST_LIST"])
    assert bytes(w.received[-1].get_msgbuf()) == request


def test_a_flight_controller_without_commands_is_no_error(wires):
    """PX4 in HITL may send no commands while disarmed."""
    w = wires()
    for k in range(200):
        w.plant.sendall(w.codec.encode(sensor(4_000 * k)))
        time.sleep(0.0005)
    w.until(
        lambda: [m for m in w.read() if m.get_type() == "HIL_SENSOR" and m.time_usec == 199 * 4_000]
    )
    assert w.router.process.poll() is None


def test_a_full_line_gives_a_warning_and_sensors_go_first(wires):
    w = wires("--hil-rate", "250", baud=57600)
    request = w.codec.encode(mavlink2.MAVLink_param_request_list_message(1, 1))
    k = 0

    def warned():
        nonlocal k
        k += 1
        w.plant.sendall(w.codec.encode(sensor(4_000 * k)))
        for _ in range(5):
            w.bridge.sendto(request, ("127.0.0.1", w.udp))
        w.read()
        return "% of the line" in w.router.output

    w.until(warned)
    assert "bytes/s to the flight controller" in w.router.output
    kinds = [m.get_type() for m in w.received]
    # five requests were sent with each sample; a stalled router loses some of both
    assert 3 * kinds.count("HIL_SENSOR") > kinds.count("PARAM_REQUEST_LIST")


def test_the_router_continues_after_reconnection(wires):
    w = wires()
    w.unplug()
    w.router.until_logged("lost: motor commands are zero")
    answer = Framer(Codec(9, 9)).stream(w.plant.recv(500))[0]
    assert answer.mode == 0 and set(answer.controls) == {0.0}
    w.plug()
    w.router.until_logged("flight controller is open")
    w.plant.sendall(w.codec.encode(sensor(8_000)))
    w.until(lambda: [m for m in w.read() if m.get_type() == "HIL_SENSOR"])
    assert w.router.interrupt(times=3) == 0 and "Traceback" not in w.router.output


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["pigeon:coop"], "allowed: udp:HOST:PORT"),
        (["serial:/dev/null:921600"], "serial device /dev/null"),
        (["serial:/dev/nothing:921600"], "does not exist"),
        (["udp:127.0.0.1:9", "--wait", "0.2", "--sim-port", "1"], "no simulator at 127.0.0.1:1"),
        (["udp:127.0.0.1:9", "--hil-rate", "0"], "not a rate"),
        (["udp:127.0.0.1:9", "--instance", "x"], "not an instance number"),
        ([], "LINK"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(start, arguments, complaint):
    ports = ["--mavlink-port", str(free_port())]
    router = start(ROUTER, *ports, *arguments)
    assert router.process.wait(PATIENCE) == 2
    assert complaint in router.output.strip().splitlines()[-1]
    assert "Traceback" not in router.output


def test_a_line_too_slow_for_any_flight_is_refused(start):
    far, near = os.openpty()
    router = start(ROUTER, f"serial:{os.ttyname(near)}:57600")
    assert router.process.wait(PATIENCE) == 2
    assert "5760 bytes/s do not carry" in router.output and "Traceback" not in router.output
    os.close(far)
    os.close(near)


def test_help_has_examples(start):
    router = start(ROUTER, "--help")
    assert router.process.wait(PATIENCE) == 0
    assert "hitl_router serial:/dev/ttyACM0:921600" in router.output
