"""The laboratory as a node: its devices on real pseudo-terminals and sockets, its truth on ROS."""

import subprocess
import sys
import time

import pytest
from free_port import free_port

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import read_state
from uam_sim_bridge.devices.mocap.natnet_source import NatNetSource
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer
from uam_sim_bridge.mavlink.transport.transport import open_transport

MODULE = "uam_sim_bridge.nodes.laboratory"
PATIENCE = 60.0  # [s]


@pytest.fixture
def laboratory(start, tmp_path):
    """The node, and the TCP port for the autopilot."""

    def make(*settings):
        port = free_port()
        own = (
            f"folder:={tmp_path}",
            "hardware:=s500_lab",
            "mocap_port:=0",
            f"hil_port:={port}",
            f"magnet_line:={tmp_path / 'magnet'}",
            *settings,
        )
        words = [word for one in own for word in ("-p", one)]
        return start(MODULE, "--ros-args", *words), port

    return make


def until(condition, what):
    end = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < end, what
        time.sleep(0.01)
    return found


def test_the_devices_answer_and_the_truth_is_published(laboratory, probe, tmp_path):
    truth = probe.collect(topics.TRUTH_STATE)
    node, port = laboratory()
    ready = tmp_path / "ready"
    until(ready.exists, "the devices")
    assert {"ttyARM", "ttyTELEM2", "ttyAUTOPILOT"} <= {one.name for one in tmp_path.iterdir()}
    autopilot = subprocess.Popen(
        [
            *(sys.executable, "-m", "uam_sim_bridge.autopilot.server", "--once"),
            *("--sim-port", str(port), "--companion", f"{tmp_path / 'ttyAUTOPILOT'}:921600"),
        ]
    )
    cameras = NatNetSource("127.0.0.1", int(ready.read_text()))
    line = open_transport(f"serial:{tmp_path / 'ttyTELEM2'}:921600")
    framer = Framer(Codec(1, 191))
    try:
        probe.until(lambda: truth, "the truth")
        stamp, _ = read_state(truth[-1])
        assert abs(1e-9 * stamp - time.time()) < PATIENCE  # of the system's clock

        def heard():
            return {m.get_type() for data in line.receive() for m in framer.stream(data)}

        until(lambda: "HEARTBEAT" in heard(), "the autopilot at the cable's near end")
        frames = until(lambda: cameras.frames(0.05), "frames of the cameras")
        assert "uam" in frames[-1].bodies
    finally:
        line.close()
        cameras.close()
        autopilot.terminate()
        autopilot.wait()
    assert node.interrupt() == 0, node.output
    assert not (tmp_path / "ttyARM").exists()


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("imu:=mine", "imu: 'mine' is not one of autopilot, topic"),
        ("calibration:=none", "unknown mocap 'none'"),
        ('faults:=\'{"seed": 1, "faults": [{"fault": "wire"}]}\'', "unknown fault 'wire'"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(laboratory, setting, reason):
    node, _ = laboratory(setting)
    assert node.process.wait(PATIENCE) == 2
    assert reason in node.output and node.output.count("\n") == 1
