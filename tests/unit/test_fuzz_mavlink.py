"""A short seeded run of benchmarks/fuzz_mavlink.py, and the errors that its full run found."""

import struct
import sys
from collections import deque

import fuzz_mavlink
import numpy as np
import pytest

from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.server import Server
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, _frame_end, checksum_fits, mavlink2


def test_random_bytes_and_mutated_messages_raise_no_error():
    campaign = fuzz_mavlink.Campaign(seed=11)
    try:
        campaign.random_bytes(400_000, lambda share: None)
        campaign.mutated_messages(8_000, lambda share: None)
    finally:
        campaign.close()
    counts = campaign.counts
    assert campaign.bytes >= 400_000 and campaign.messages >= 8_000
    # the campaign reached arming, flight and answers
    for what in ("setpoints", "arm requests", "armed motor answers", "motor commands"):
        assert counts[what] > 0, counts


def test_the_same_seed_gives_the_same_input():
    found = []
    for _ in range(2):
        campaign = fuzz_mavlink.Campaign(seed=5)
        try:
            campaign.mutated_messages(400, lambda share: None)
        finally:
            campaign.close()
        found.append((campaign.counts, list(campaign.inputs)))
    assert found[0] == found[1]


def test_a_failure_leaves_its_seed_and_input(tmp_path, monkeypatch, capsys):
    def broken(self, chunks):
        raise ValueError("broken")

    monkeypatch.setattr(fuzz_mavlink.Bridge, "feed", broken)
    file = tmp_path / "failure.json"
    arguments = ["fuzz_mavlink", "--bytes", "1e4", "--messages", "10", "--save", str(file)]
    monkeypatch.setattr(sys, "argv", arguments)
    assert fuzz_mavlink.main() == 1
    assert "random bytes to the bridge: ValueError: broken" in capsys.readouterr().err
    assert '"inputs"' in file.read_text()


class Silence:
    """A transport or socket with given received chunks."""

    stream, connected, dropped = False, True, 0

    def __init__(self, *chunks):
        self.chunks, self.sent = deque(chunks), []

    def recv(self, size):
        return self.chunks.popleft() if self.chunks else b""

    def receive(self):
        arrived, self.chunks = list(self.chunks), deque()
        return arrived

    def send(self, data):
        self.sent.append(data)

    sendall = send


def test_parameters_without_a_request_are_not_stored():
    """Error found: every new name in a PARAM_VALUE was stored forever."""
    codec = Codec(1, 1)
    names = [f"P{k}".encode() for k in range(500)] + [b"MC_ROLLRATE_P"]
    transport = Silence(
        *(
            codec.encode(mavlink2.MAVLink_param_value_message(name, 0.15, 9, 501, 0))
            for name in names
        )
    )
    link = OffboardLink(transport, OffboardSequence(), RateThrustParameters.of(load_description()))
    link.poll(0.0)
    assert list(link.parameters.values) == ["MC_ROLLRATE_P"]


@pytest.mark.parametrize("microseconds", [2**63 // 1000, 2**63, 2**64 - 1])
def test_a_sample_with_a_huge_time_does_not_end_the_autopilot(microseconds):
    """Error found: telemetry at such a time overflowed MAVLink's fields, and the server ended."""
    codec = Codec(1, 200)

    def sample(time):
        return codec.encode(
            mavlink2.MAVLink_hil_sensor_message(
                time, 0, 0, -9.81, 0, 0, 0, 0.2, 0, 0.4, 1013, 0, 0, 20, 0x1FFF, 0
            )
        )

    class Udp(Silence):
        def send(self, messages):
            self.sent += [codec.encode(message) for message in messages]

    simulator, udp = Silence(sample(4000), sample(microseconds), sample(8000)), Udp()
    Server(Autopilot(), simulator, udp).run()
    answers = [Framer(Codec(1, 1)).datagram(data)[0].time_usec for data in simulator.sent]
    assert answers == [4000, 8000]
    assert udp.sent


def test_checksum_fits_skips_only_frames_that_decoding_refuses():
    """checksum_fits saves decoding time and changes no result."""
    random = np.random.default_rng(2)
    codec = Codec(1, 1)
    good = codec.encode(mavlink2.MAVLink_attitude_quaternion_message(1, 1, 0, 0, 0, 0, 0, 0))
    first = struct.pack("<BBBBBBI", 0xFE, 4, 0, 1, 1, 4, 7)
    for frame in (good, first, b"\xfd\x00\x00", good[:5], b"\xfe\x00" + bytes(6)):
        for _ in range(200):
            data = bytearray(frame)
            data[random.integers(len(data))] ^= 1 << random.integers(8)
            data = bytes(data)
            end = _frame_end(data, 0)
            if end == len(data):
                assert checksum_fits(data, 0, end) or codec.decode(data) is None
    assert checksum_fits(good, 0, len(good))
