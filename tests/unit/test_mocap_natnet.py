"""Driver and emulated server over real sockets, with the public clients in between."""

import json
import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mocap_room import Disturbances, MocapRoom
from natnet import NatNetClient
from natnet.data_descriptions import DataDescriptions
from natnet.data_frame import DataFrame
from natnet.packet_buffer import PacketBuffer
from natnet.version import Version
from tracked_vehicle import TrackedBody

from uam_control.maths.rotations import matrix_from_quaternion, quaternion_from_euler
from uam_sim_bridge.devices.mocap import calibration as calibrations
from uam_sim_bridge.devices.mocap import driver as driver_module
from uam_sim_bridge.devices.mocap import natnet_messages
from uam_sim_bridge.devices.mocap.driver import Level, MocapDriver
from uam_sim_bridge.devices.mocap.emulated import natnet_packets as packets
from uam_sim_bridge.devices.mocap.emulated.mocap_server import Streaming
from uam_sim_bridge.devices.mocap.frame import BodyPose, Frame, MocapError
from uam_sim_bridge.devices.mocap.library_source import LibrarySource
from uam_sim_bridge.devices.mocap.mocap_parameters import MocapParameters
from uam_sim_bridge.devices.mocap.natnet_source import NatNetSource
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

PATIENCE = 60.0  # [s]
POSITION = np.array([1.0, 2.0, 0.5])
QUATERNION = quaternion_from_euler(np.array([0.1, -0.2, 1.3]))
MOTIVE = (1.0, 0.5, -2.0)  # the same place with Y up
MEASURED = calibrations.Calibration(
    "y", 0.0, (0.0,) * 3, calibrations.load("motive_y_up").body, (0.0,) * 3, {"distance_m": 1.0}
)
finite = st.floats(-1e3, 1e3, width=32)
stamps = st.builds(packets.Stamps, *[st.floats(0.0, 1e6)] * 3)
bodies = st.dictionaries(
    st.integers(1, 500),
    st.builds(
        packets.WireBody,
        st.tuples(finite, finite, finite),
        st.tuples(*[st.floats(-1, 1, width=32)] * 4),
        st.booleans(),
    ),
    max_size=4,
)
words = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=20)


def still(_):
    return {"uam": (POSITION, QUATERNION), "box": (np.zeros(3), np.array([1.0, 0, 0, 0]))}


def poses_of(truth, payload_top):
    """name → position and quaternion; payload_top [m]: its pose is the middle of its upper side."""
    up = matrix_from_quaternion(truth.payload_quaternion)[:, 2]
    return {
        "uam": (truth.state[0, :3].copy(), truth.quaternion.copy()),
        "payload": (truth.payload_position + payload_top * up, truth.payload_quaternion.copy()),
    }


def serving(names=("uam", "box"), poses=still, disturbances=None, seed=0, **how):
    bodies = [TrackedBody(name) for name in names]
    return MocapRoom(bodies, poses, Streaming(**how), disturbances, seed)


@pytest.fixture
def connect():
    """server → driver with its source; both are closed at the end."""
    sources = []

    def make(server, calibration=MEASURED, **parameters):
        source = NatNetSource("127.0.0.1", server.port)
        sources.append(source)
        return MocapDriver(MocapParameters(**parameters), calibration, source)

    yield make
    for source in sources:
        source.close()


def until(driver, condition, what):
    """Receive until `condition()`; return the poses."""
    found, end = [], time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"{what}: {driver.health()} {driver.values()}"
        found += driver.receive(0.02)
    return found


def poses(driver, count):
    found = []
    until(driver, lambda: found.extend(driver.receive(0.02)) or len(found) >= count, "poses")
    return found


@given(st.sampled_from(packets.VERSIONS), st.integers(0, 2**31), stamps, bodies, st.booleans())
@settings(deadline=None)
def test_the_public_reader_reads_every_frame(version, number, times, there, changed):
    data = packets.frame(version, number, times, there, changed)
    header = natnet_messages.HEADER.unpack_from(data)
    assert header == (natnet_messages.FRAME, len(data) - 4)
    read = DataFrame.read_from_buffer(PacketBuffer(data[4:]), Version(*version))
    assert read.prefix.frame_number == number
    assert read.suffix.tracked_models_changed == changed
    assert read.suffix.timestamp == times.exposed
    assert read.suffix.stamp_camera_mid_exposure == round(times.exposed * packets.FREQUENCY)
    assert read.suffix.stamp_transmit == round(times.sent * packets.FREQUENCY)
    assert {
        body.id_num: (body.pos, body.rot, body.tracking_valid) for body in read.rigid_bodies
    } == {key: (body.position, body.rotation, body.tracked) for key, body in there.items()}


@given(st.sampled_from(packets.VERSIONS), st.dictionaries(st.integers(1, 500), words, max_size=4))
@settings(deadline=None)
def test_the_public_reader_reads_the_list_of_bodies(version, names):
    data = packets.models(version, names)
    read = DataDescriptions.read_from_buffer(PacketBuffer(data[4:]), Version(*version))
    assert {body.id_num: body.name for body in read.rigid_bodies} == names
    assert all(len(body.markers) == len(packets.MARKERS) for body in read.rigid_bodies)


@given(st.integers(0, 65535), st.booleans(), st.sampled_from(packets.VERSIONS))
def test_the_server_info_is_read(port, multicast, version):
    data = packets.server_info(version, port, multicast, "239.1.2.3")
    assert natnet_messages.read_server_info(data[4:]) == natnet_messages.ServerInfo(
        "Emulated Motive", version, packets.FREQUENCY, port, multicast, "239.1.2.3"
    )
    old = natnet_messages.read_server_info(data[4 : 4 + 264])  # NatNet 2 has no more
    assert old.frequency == 0 and old.version == version


@pytest.mark.parametrize("version", packets.VERSIONS)
def test_the_public_client_runs_with_the_emulated_server(version):
    with serving(version=version) as server:
        client = NatNetClient("127.0.0.1", command_port=server.port, use_multicast=False)
        frames, lists, both = [], [], threading.Event()
        client.on_data_frame_received_event.handlers.append(frames.append)
        client.on_data_description_received_event.handlers.append(lists.append)
        client.on_data_frame_received_event.handlers.append(
            lambda _: both.set() if lists and len(frames) > 5 else None
        )
        with client:
            client.request_modeldef()
            client.run_async()
            assert both.wait(PATIENCE)
    assert client.server_info is None
    assert [body.name for body in lists[0].rigid_bodies] == ["uam", "box"]
    assert frames[-1].rigid_bodies[0].pos == pytest.approx(MOTIVE)


@pytest.mark.parametrize("multicast", [False, True], ids=["unicast", "multicast"])
@pytest.mark.parametrize("version", packets.VERSIONS)
def test_the_driver_delivers_the_pose_with_the_stamp_of_its_exposure(connect, version, multicast):
    exposures = []

    def moving(time_now):
        exposures.append(time_now)
        return {"uam": (np.array([0.0, 0.0, time_now % 100.0]), QUATERNION)}

    with serving(poses=moving, version=version, multicast=multicast) as server:
        driver = connect(server)
        driver.check_names()
        found = poses(driver, 20)
        until(driver, lambda: driver.health()[0] is Level.OK, "good health")
        said = driver.health()[1]
    times = np.array(exposures)
    for pose in found:
        np.testing.assert_allclose(pose.quaternion, QUATERNION, atol=1e-6)
        exposed = times[np.argmin(np.abs(times % 100.0 - pose.position[2]))]
        assert pose.stamp * 1e-9 - exposed > -1e-3  # never before it
    assert pose.stamp * 1e-9 - exposed < 1.0  # late by the shortest delay of a busy machine
    assert np.all(np.diff([pose.stamp for pose in found]) > 0)
    way = "multicast 239.255.42.99" if multicast else "unicast"
    assert way in said


def test_latency_is_that_of_the_server_and_the_stamps_lie_at_the_exposure(connect):
    """By the server's stamps alone: the least delay of the network is some 0.1 ms."""
    with serving(latency=0.03) as server:
        driver = connect(server)
        poses(driver, 60)
    assert float(driver.values()["latency median [ms]"]) > 29.0


def test_losses_are_counted_repeated_and_late_frames_discarded(connect):
    how = Disturbances(loss=0.2, repeat=0.2, swap=0.2)
    with serving(rate=400.0, disturbances=how, seed=3) as server:
        driver = connect(server)
        count = driver.count
        found = until(
            driver, lambda: count.lost > 10 and count.repeated > 10 and count.late > 10, "faults"
        )
    assert np.all(np.diff([pose.stamp for pose in found]) > 0)
    assert driver.values()["frames lost"] == count.lost
    assert len(found) == count.received


def test_damaged_packets_are_counted_and_do_not_end_the_driver(connect):
    """A changed byte is read as another number, or the packet as unreadable; never an exception."""
    with serving(rate=400.0, disturbances=Disturbances(damage=0.9), seed=4) as server:
        driver = connect(server)
        until(driver, lambda: driver.values()["packets unreadable"] > 3, "unreadable packets")
        server.disturbances = Disturbances()
        until(driver, lambda: driver.health()[0] is Level.OK, "undamaged poses")


def test_a_hidden_body_is_silent_and_the_health_says_so(connect):
    with serving() as server:
        driver = connect(server, silent_after=0.1)
        poses(driver, 5)
        server.occlude("uam")
        # frames that come late are an error, too, with other words
        until(driver, lambda: "body 'uam' is not tracked" in driver.health()[1], "an error")
        assert driver.health()[0] is Level.ERROR
        assert not [p for _ in range(10) for p in driver.receive(0.02)]
        assert driver.values()["not tracked: uam"] > 0
        server.occlude("uam", hidden=False)
        assert poses(driver, 5)


def test_a_renamed_or_deleted_body_is_silent_and_the_health_names_those_that_are_there(connect):
    with serving() as server:
        driver = connect(server)
        poses(driver, 5)
        server.rename("uam", "hexa")
        until(driver, lambda: "no rigid body 'uam'" in driver.health()[1], "an error")
        assert driver.health() == (
            Level.ERROR,
            "no rigid body 'uam' in Emulated Motive, NatNet 3.1, unicast, 127.0.0.1; "
            "there are: box, hexa",
        )
        assert not [p for _ in range(10) for p in driver.receive(0.02)]
        server.rename("hexa", "uam")
        assert poses(driver, 5)
        server.remove("uam")
        until(driver, lambda: "there are: box" in driver.health()[1], "an error")


def test_a_body_that_does_not_exist_is_refused_at_the_start(connect, monkeypatch):
    monkeypatch.setattr(driver_module, "START_TIME", PATIENCE)
    with serving() as server:
        with pytest.raises(MocapError, match="no rigid body 'drone' .* there are: box, uam"):
            connect(server, body="drone").check_names()
        with pytest.raises(MocapError, match="no rigid body 'cube'"):
            connect(server, payload="cube").check_names()


def test_the_payload_has_its_own_pose(connect):
    with serving() as server:
        driver = connect(server, payload="box")
        found = poses(driver, 10)
    payload = next(pose for pose in found if pose.payload)
    np.testing.assert_allclose(payload.position, np.zeros(3), atol=1e-6)
    np.testing.assert_allclose(payload.quaternion, (1, 0, 0, 0), atol=1e-6)
    assert {pose.payload for pose in found} == {True, False}


def test_a_paused_and_a_restarted_server(connect):
    with serving() as server:
        driver, port = connect(server, silent_after=0.1), server.port
        poses(driver, 5)
        server.pause()
        until(driver, lambda: "no frames from" in driver.health()[1], "an error")
        server.pause(False)
        poses(driver, 5)
    until(driver, lambda: "no answer of 127.0.0.1" in driver.health()[1], "an error")
    with serving(port=port, clock=(-1.6e9, 0.0)):  # another clock, and it counts from 1
        found = poses(driver, 5)
        until(driver, lambda: driver.health()[0] is Level.OK, "poses")
        assert abs(found[-1].stamp * 1e-9 - time.time()) < PATIENCE
        # more than two if a stall looked like a silent server
        assert driver.values()["connections"] >= 2 and driver.count.lost == 0


def test_a_server_that_comes_later_is_found(connect):
    with serving() as server:
        port = server.port
    late = serving(port=port)
    late.stop()
    driver = connect(late)
    driver.check_names()  # no answer is no error
    assert driver.health()[0] is Level.ERROR and "is it on" in driver.health()[1]
    with serving(port=port):
        assert poses(driver, 3)


def test_packets_of_another_server_in_the_group_are_ignored(connect):
    with serving(multicast=True) as server:
        driver = connect(server)
        poses(driver, 3)
        with serving(
            poses=lambda _: {"uam": (np.full(3, 9.0), QUATERNION)},
            multicast=True,
            address="127.0.0.2",
            data_port=server.data_port,
        ):
            assert all(pose.position[0] == pytest.approx(1.0) for pose in poses(driver, 30))


def test_a_group_that_cannot_be_joined_is_said_and_tried_again(connect):
    with serving(multicast=True) as server:
        driver = connect(server)
        source = driver._source
        here, source._local = source._local, "203.0.113.7"  # an address that the computer lost
        until(driver, lambda: source.failure, "failure")
        assert source.failure.startswith("cannot receive the frames: ")
        source._local = here
        assert poses(driver, 3)


@pytest.mark.parametrize(
    ("server", "local", "reason"),
    [
        ("no.such.host.invalid", "", "server no.such.host"),
        ("127.0.0.1", "203.0.113.7", "local 203"),
    ],
)
def test_an_address_that_cannot_be_is_refused_in_one_line(server, local, reason):
    with pytest.raises(MocapError, match=reason) as refused:
        NatNetSource(server, 1510, local)
    assert "\n" not in str(refused.value)


def test_a_source_without_stamps_assumes_a_latency():
    class Stampless:
        connected, names, bad, sessions = True, ("uam",), 0, 1
        description, failure = "a source", ""

    driver = MocapDriver(MocapParameters(assumed_latency=0.02), MEASURED, Stampless())
    pose = BodyPose(np.array(MOTIVE), np.array([1.0, 0, 0, 0]))
    (found,) = driver.take(Frame(1_000_000_000, None, None, None, {"uam": pose}))
    assert found.stamp == 980_000_000
    np.testing.assert_allclose(found.position, POSITION, atol=1e-7)
    (again,) = driver.take(Frame(1_000_000_000, None, None, None, {"uam": pose}))
    assert again.stamp == found.stamp + 1000  # stamps grow
    assert driver.take(Frame(1_100_000_000, None, None, None, {"uam": None})) == []
    assert driver.values()["not tracked: uam"] == 1


@pytest.mark.parametrize("version", packets.VERSIONS)
def test_the_library_motioncapture_reads_the_emulated_server(version):
    pytest.importorskip("motioncapture")
    with serving(version=version, multicast=True) as server:
        source = LibrarySource("optitrack", "127.0.0.1", "127.0.0.1", server.port)
        driver = MocapDriver(MocapParameters(source="motioncapture"), MEASURED, source)
        try:
            found = poses(driver, 5)
            until(driver, lambda: driver.health()[0] is Level.OK, "good health")
            assert set(source.names) == {"uam", "box"}
        finally:
            source.close()
    np.testing.assert_allclose(found[-1].position, POSITION, atol=1e-6)
    np.testing.assert_allclose(found[-1].quaternion, QUATERNION, atol=1e-6)
    assert abs(found[-1].stamp * 1e-9 - time.time()) < 30.0


def test_a_library_that_fails_is_said_and_started_again():
    pytest.importorskip("motioncapture")
    source = LibrarySource("vrpn", "127.0.0.1")
    source._command[3] = "no_such_system"
    driver = MocapDriver(MocapParameters(source="motioncapture"), MEASURED, source)
    try:
        until(driver, lambda: source.sessions >= 2 and source.failure, "two attempts")
        assert "Unknown motion capture type" in driver.health()[1]
    finally:
        source.close()


def test_the_process_of_the_library_prints_one_line_per_frame():
    pytest.importorskip("motioncapture")
    with serving(multicast=True) as server:
        options = {
            "hostname": "127.0.0.1",
            "interface_ip": "127.0.0.1",
            "port_command": str(server.port),
        }
        command = [sys.executable, "-m", "uam_sim_bridge.devices.mocap.library_source"]
        process = subprocess.Popen(
            [*command, "optitrack", json.dumps(options)], stdout=subprocess.PIPE, env=os.environ
        )
        try:
            arrival, there = json.loads(process.stdout.readline())
        finally:
            process.kill()
            process.wait()
            process.stdout.close()
    assert there["uam"][:3] == pytest.approx(MOTIVE) and arrival > 1e18


def test_a_simulation_exposes_at_its_own_ticks(connect):
    """MuJoCo falls from 1 m; each pose is the truth of the tick with its stamp."""
    plant = MujocoPlant(Vehicle.load(), 0.2, 1)
    top, truths = 0.05, {}
    with serving(("uam", "payload"), poses=None) as server:
        driver = connect(server, payload="payload")
        until(driver, lambda: driver.values()["connections"], "the connection")
        begun, found, end = time.time(), [], time.monotonic() + PATIENCE
        while len(found) < 40 and time.monotonic() < end:
            host = begun + plant.time
            poses_now = poses_of(plant.truth(), top)
            if server.expose(host, poses_now):
                truths[host] = poses_now
            plant.step(np.full(4, 0.3), np.zeros(2), False)
            time.sleep(max(0.0, begun + plant.time - time.time()))
            found += driver.receive(0.0)
    assert len(found) >= 40
    for pose in found:
        there = [poses_now["payload" if pose.payload else "uam"] for poses_now in truths.values()]
        position, quaternion = min(there, key=lambda one: np.linalg.norm(one[0] - pose.position))
        np.testing.assert_allclose(pose.position, position, atol=1e-6)
        np.testing.assert_allclose(np.abs(pose.quaternion), np.abs(quaternion), atol=1e-5)
    hosts = np.diff(list(truths))
    assert hosts.min() > 0.007 and np.mean(hosts) == pytest.approx(1 / 120, rel=0.05)
    upper = poses_of(plant.truth(), top)["payload"][0] - plant.truth().payload_position
    np.testing.assert_allclose(upper, (0.0, 0.0, top), atol=1e-6)
