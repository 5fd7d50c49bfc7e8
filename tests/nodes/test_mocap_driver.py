"""The motion capture node over real ROS, with the emulated NatNet server on the other end."""

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from mocap_room import MocapRoom
from tracked_vehicle import TrackedBody

from uam_control.maths.rotations import quaternion_from_euler
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import read_pose
from uam_sim_bridge.devices.mocap.calibration import Calibration, load, text

MODULE, NAME = "uam_sim_bridge.nodes.mocap_driver", "mocap_driver"
POSITION = np.array([0.5, -1.0, 1.2])
QUATERNION = quaternion_from_euler(np.array([0.1, 0.2, -2.0]))
PIVOT = (0.02, 0.01, 0.06)
PAYLOAD = np.array([-1.0, 0.0, 0.1])


def poses(_):
    return {"uam": (POSITION, QUATERNION), "box": (PAYLOAD, np.array([1.0, 0, 0, 0]))}


@pytest.fixture
def server():
    with MocapRoom([TrackedBody("uam", pivot=PIVOT), TrackedBody("box")], poses) as made:
        yield made


@pytest.fixture
def calibration(tmp_path):
    """A measured calibration of that body."""
    file = tmp_path / "lab.yaml"
    body = load("motive_y_up").body
    file.write_text(text(Calibration("y", 0.0, (0.0,) * 3, body, PIVOT, {"distance_m": 1.0})))
    return str(file)


def arguments(there, **values):
    values = {"command_port": there.port} | values
    return ["--ros-args", *(w for k, v in values.items() for w in ("-p", f"{k}:={v}"))]


def health(reports):
    found = [s for m in reports for s in m.status if s.name == NAME]
    return found[-1] if found else DiagnosticStatus()


def test_poses_of_vehicle_and_payload_are_published_with_stamps_of_the_host(
    start, probe, server, calibration
):
    vehicle, payload = probe.collect(topics.MOCAP), probe.collect(topics.PAYLOAD)
    reports = probe.collect(topics.DIAGNOSTICS)
    node = start(MODULE, *arguments(server, calibration=calibration, payload="box"))
    probe.until(lambda: len(vehicle) > 30 and len(payload) > 30, "poses")
    stamp, position, quaternion = read_pose(vehicle[-1])
    np.testing.assert_allclose(position, POSITION, atol=1e-5)
    np.testing.assert_allclose(quaternion, QUATERNION, atol=1e-5)
    np.testing.assert_allclose(read_pose(payload[-1])[1], PAYLOAD, atol=1e-6)
    assert abs(stamp * 1e-9 - time.time()) < 60.0
    stamps = [read_pose(data)[0] for data in vehicle]
    assert all(b > a for a, b in zip(stamps, stamps[1:], strict=False))
    probe.until(lambda: health(reports).message.startswith("poses of 'uam'"), "health")
    values = {pair.key: pair.value for pair in health(reports).values}
    assert float(values["latency median [ms]"]) >= 3.9 and values["frames lost"].isdigit()
    assert health(reports).level == DiagnosticStatus.OK
    assert node.interrupt() == 0 and "Traceback" not in node.output


def test_a_renamed_body_leaves_the_topic_silent_and_is_an_error_until_it_returns(
    start, probe, server, calibration
):
    found, reports = probe.collect(topics.MOCAP), probe.collect(topics.DIAGNOSTICS)
    node = start(MODULE, *arguments(server, calibration=calibration))
    probe.until(lambda: len(found) > 5, "poses")
    server.rename("uam", "hexa")
    node.until_logged("no rigid body 'uam' in Emulated Motive")
    probe.until(lambda: health(reports).message.endswith("there are: box, hexa"), "the names")
    assert health(reports).level == DiagnosticStatus.ERROR
    reports.clear()
    probe.until(lambda: reports, "a report after which no older pose comes")
    found.clear()
    reports.clear()
    probe.until(lambda: reports, "a report")
    assert not found
    server.rename("hexa", "uam")
    probe.until(lambda: len(found) > 5, "poses again")
    server.stop()
    node.until_logged("no answer of 127.0.0.1")
    assert node.process.poll() is None  # it goes on asking


def test_a_nominal_calibration_is_warned_about(start, probe, server):
    reports = probe.collect(topics.DIAGNOSTICS)
    node = start(MODULE, *arguments(server))
    node.until_logged("calibration motive_y_up is nominal, not measured: uam calibrate-mocap")
    probe.until(lambda: health(reports).level == DiagnosticStatus.WARN, "a warning")


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"source": "sonar"}, "source: 'sonar' is not one of natnet, motioncapture"),
        ({"calibration": "lab7"}, "calibration: unknown mocap 'lab7'; there are: motive_y_up"),
        ({"server": "no.such.host.invalid"}, "server no.such.host.invalid"),
        ({"silent_after": "0.0"}, "silent_after: 0.0 is outside 0.02 to 10 s"),
        ({"body": "drone"}, "no rigid body 'drone' in Emulated Motive"),
        ({"payload": "uam"}, "payload: 'uam' is the vehicle's body, too"),
        ({"no_such": "1"}, "no_such: unknown; allowed: "),
    ],
)
def test_wrong_values_are_refused_in_one_line(start, server, values, complaint):
    node = start(MODULE, *arguments(server, **values))
    assert node.process.wait(60) == 2
    assert complaint in node.output and node.output.count("\n") == 1, node.output
