"""Forwarding for a ground station: passing messages, limits, separation from the link."""

import random
import socket
import time

import numpy as np
import pytest

from uam_control.offboard.exchange import Request
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.setpoints.targets import AttitudeTarget
from uam_control.vehicle import load_description
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Signing, mavlink2
from uam_sim_bridge.mavlink.transport.faulty_transport import GroundStation
from uam_sim_bridge.ports import PortError

PATIENCE = 30.0  # s
SPEED = 92160.0  # bytes/s


class Line:
    """The autopilot's transport; the test sets the received bytes."""

    stream, connected, dropped = True, True, 0

    def __init__(self, bytes_per_second=None):
        self.bytes_per_second = bytes_per_second
        self.arriving, self.sent = [], []

    def send(self, data):
        self.sent.append(data)
        return True

    def receive(self):
        chunks, self.arriving = self.arriving, []
        return chunks

    def fileno(self):
        return -1

    def close(self):
        self.connected = False


class Rig:
    """A station's socket, the forwarder and the line; `now`: wall time [s] set by the test."""

    def __init__(self, bytes_per_second=None, signing=None):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(PATIENCE)
        self.now = 0.0
        self.line = Line(bytes_per_second)
        self.gcs = GroundStation(
            f"udp:localhost:{self.socket.getsockname()[1]}",
            self.line,
            Codec(1, 191, signing),
            lambda: self.now,
        )
        self.line.arriving = [b"hello"]
        self.gcs.receive()
        _, self.place = self.socket.recvfrom(100)
        self.codec = Codec(255, 190)

    def send(self, *messages):
        for message in messages:
            self.socket.sendto(self.codec.encode(message), self.place)

    def forward_all(self, count):
        """Forward until `count` messages were forwarded or held back."""
        end = time.monotonic() + PATIENCE
        while self.gcs.forwarded + self.gcs.held_back < count:
            assert time.monotonic() < end
            self.gcs.forward()


@pytest.fixture
def make():
    rigs = []

    def rig(*arguments, **options):
        rigs.append(Rig(*arguments, **options))
        return rigs[-1]

    yield rig
    for r in rigs:
        r.gcs.close()
        r.socket.close()


def arm(system=1):
    return mavlink2.MAVLink_command_long_message(system, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)


def heartbeat():
    return mavlink2.MAVLink_heartbeat_message(2, 12, 0x81, 6 << 16, 4, 3)


def test_the_station_receives_the_bytes_unchanged(make):
    rig = make()
    chunks = [b"\xfd\x01garbage", Codec(1, 1).encode(heartbeat())[:7], bytes(range(200))]
    rig.line.arriving = list(chunks)
    assert rig.gcs.receive() == chunks
    assert [rig.socket.recv(500) for _ in chunks] == chunks


def test_long_chunks_reach_the_station_in_pieces(make):
    rig = make()
    chunk = random.Random(1).randbytes(70_000)
    rig.line.arriving = [chunk]
    rig.gcs.receive()
    got = b""
    while len(got) < len(chunk):
        got += rig.socket.recv(65535)
    assert got == chunk


def test_whole_valid_messages_reach_the_autopilot_unchanged(make):
    rig = make()
    frame = rig.codec.encode(arm())
    for data in (b"garbage\xfd\xfe" + frame, frame[:20], frame[20:], frame[:-1] + b"\x00" + frame):
        rig.socket.sendto(data, rig.place)
    rig.forward_all(2)
    assert rig.line.sent == [frame, frame]


def test_the_bytes_forwarded_per_tick_are_bounded(make):
    rig = make()
    size = len(rig.codec.encode(arm()))
    rig.send(*[arm()] * 200)
    before = 0
    end = time.monotonic() + PATIENCE
    while rig.gcs.forwarded < 200:
        assert time.monotonic() < end
        rig.gcs.forward()
        assert (rig.gcs.forwarded - before) * size <= 2048 + size
        before = rig.gcs.forwarded
    assert len(rig.line.sent) == 200


def test_invalid_bytes_do_not_block_later_messages(make):
    rig = make()
    noise = random.Random(4)
    for _ in range(100):
        rig.socket.sendto(noise.randbytes(1400), rig.place)
    for _ in range(200):
        rig.gcs.forward()
    rig.send(arm())
    rig.forward_all(1)
    assert len(rig.line.sent) == 1


def test_on_a_slow_line_the_station_gets_its_share_and_no_more(make):
    rig = make(SPEED)
    ticks = 500
    for k in range(ticks):
        rig.now = 0.004 * k
        rig.send(*[arm()] * 10)
        rig.gcs.forward()
    rig.forward_all(10 * ticks)
    size = len(rig.line.sent[0])
    allowed = 0.2 * SPEED * (rig.now + 0.01) + size
    assert 0.9 * allowed < sum(map(len, rig.line.sent)) <= allowed
    assert rig.gcs.held_back > 0


def test_with_signing_only_messages_with_the_key_pass(make):
    signing = Signing(bytes(range(32)))
    rig = make(signing=signing)
    rig.send(arm())
    signed = Codec(255, 190, signing).encode(arm())
    for frame in (signed, signed):  # the second is a replay
        rig.socket.sendto(frame, rig.place)
    rig.forward_all(1)
    rig.gcs.forward()
    assert rig.line.sent == [signed]


def test_the_link_does_not_receive_the_stations_messages(make):
    rig = make()
    sequence = OffboardSequence()
    link = OffboardLink(rig.gcs, sequence, RateThrustParameters.of(load_description()))
    rig.codec = Codec(1, 1)  # the station uses the autopilot's ids
    rig.send(heartbeat(), mavlink2.MAVLink_statustext_message(2, b"critical"))
    rig.forward_all(2)
    link.poll(1.0)
    assert not link.connected(1.0) and link.mode is Mode.UNKNOWN and sequence.reasons == ()
    # the link ignores the autopilot's answer to the station
    ack = mavlink2.MAVLink_command_ack_message(400, 0, 0, 0, 255, 190)
    link._pending[400] = Request.ARM
    rig.line.arriving = [Codec(1, 1).encode(ack)]
    link.poll(2.0)
    assert not link.armed and link.ignored == 1
    ack = mavlink2.MAVLink_command_ack_message(400, 0, 0, 0, 1, 191)
    rig.line.arriving = [Codec(1, 1).encode(ack)]
    link.poll(3.0)
    assert link.armed


def test_chunks_of_a_stream_are_joined_by_the_link(make):
    rig = make()
    link = OffboardLink(rig.gcs, OffboardSequence(), RateThrustParameters.of(load_description()))
    frame = Codec(1, 1).encode(heartbeat())
    for piece in (frame[:9], frame[9:]):
        rig.line.arriving = [piece]
        link.poll(1.0)
    assert link.connected(1.0)
    link.send_setpoint(AttitudeTarget.of_rates(np.zeros(3), 0.5), 1.0)
    assert Framer(Codec(2, 2)).stream(rig.line.sent[-1])[0].get_type() == "SET_ATTITUDE_TARGET"


@pytest.mark.parametrize("url", ["tcp:localhost:1", "serial:/dev/ttyS0:57600", "14550"])
def test_a_station_is_reached_over_udp_only(url):
    with pytest.raises(PortError, match="udp:HOST:PORT"):
        GroundStation(url, Line(), Codec(1, 191))
