"""The links of the bridge node: UDP, serial line, ground station, signing."""

import contextlib
import os
import socket
import tty

import numpy as np
import pytest
from autopilot_on_a_line import AutopilotOnALine
from bridge_rig import MODULE, WEIGHT

from uam_control.offboard.modes import Mode
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import AutopilotState
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Signing, mavlink2


def test_a_port_in_use_is_a_one_line_error(start):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
        node = start(MODULE, "--ros-args", "-p", f"local_port:={port}")
        assert node.process.wait(60) == 2
    assert f"UDP port {port}" in node.output and "Traceback" not in node.output


def test_invalid_bytes_from_the_autopilots_port_are_ignored(make_rig):
    rig = make_rig()
    noise = np.random.default_rng(2)
    for _ in range(50):
        rig.socket.sendto(noise.bytes(int(noise.integers(1, 400))), ("127.0.0.1", rig.local))
        rig.tick()
    assert rig.node.process.poll() is None


def values(messages):
    """Return the newest values in /diagnostics."""
    return {v.key: v.value for v in messages[-1].status[0].values}


def test_link_by_url(make_rig):
    rig = make_rig("-p", "local_port:=1", "-p", "autopilot:=udp:localhost:{remote}:{local}")
    rig.fly()


class Line:
    """A pseudo-terminal in place of the rig's socket."""

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


def test_a_ground_station_receives_all_and_may_send(make_rig):
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
        # the station uses the autopilot's ids, floods the link, and sends a request
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


def test_with_signing_only_signed_messages_are_accepted(make_rig, tmp_path):
    key = "0f" * 32
    file = tmp_path / "key"
    file.write_text(key + "\n")
    rig = make_rig("-p", f"signing_key:={file}", "-p", "signing_link_id:=4")
    arrived = rig.probe.collect(topics.DIAGNOSTICS)
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
        mine = [m for m in arrived if m.status[0].name == "mavlink_bridge"]
        return mine and int(values(mine)["refused"]) > 0

    rig.probe.until(refused, "refusals under /diagnostics")
    assert key not in rig.node.output


def test_on_a_vehicle_the_autopilot_is_found_before_any_state(start, probe, tmp_path):
    """Also with another IMU: a heartbeat is seen although no tick has begun."""
    reports = probe.collect(topics.DIAGNOSTICS)
    device = tmp_path / "ttyPX4"
    settings = (f"autopilot:=serial:{device}:921600", "clock:=realtime", "wait_for_device:=true")
    start(MODULE, "--ros-args", *(word for one in settings for word in ("-p", one)))

    def reported(**values):
        found = [s for m in reports for s in m.status if s.name == "mavlink_bridge"]
        newest = {pair.key: pair.value for pair in found[-1].values} if found else {}
        return newest and all(newest[key.replace("_", " ")] == v for key, v in values.items())

    probe.until(lambda: reported(link_open="False", heartbeat="False"), "a report without it")
    with contextlib.closing(AutopilotOnALine(device)):
        probe.until(lambda: reported(link_open="True", heartbeat="True"), "the heartbeat")
    probe.until(lambda: reported(heartbeat="False"), "its loss")
