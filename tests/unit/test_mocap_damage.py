"""Damaged NatNet packets, and bodies that exchange their names: no exception, no wrong pose."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mocap_room import MocapRoom
from natnet.version import Version
from tracked_vehicle import TrackedBody

from uam_sim_bridge.devices.mocap.calibration import load
from uam_sim_bridge.devices.mocap.driver import Level, MocapDriver
from uam_sim_bridge.devices.mocap.emulated import natnet_packets as packets
from uam_sim_bridge.devices.mocap.mocap_parameters import MocapParameters
from uam_sim_bridge.devices.mocap.natnet_messages import UNREADABLE, read_frame, read_models
from uam_sim_bridge.devices.mocap.natnet_source import NatNetSource

PATIENCE = 60.0  # [s]
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
BODY = packets.WireBody((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), True)
TIMES = packets.Stamps(10.0, 10.001, 10.004)
versions = st.sampled_from(packets.VERSIONS)
changes = st.lists(st.tuples(st.integers(0, 2**16), st.integers(0, 255)), min_size=1, max_size=8)


def damaged(content, changed, cut):
    content = bytearray(content)
    for at, value in changed:
        content[at % len(content)] = value
    return bytes(content[: len(content) - cut])


def readable(read, content, version):
    try:
        read(content, Version(*version))
    except UNREADABLE:
        pass


@given(versions, changes, st.integers(0, 60))
@settings(max_examples=300, deadline=None)
def test_a_damaged_frame_is_read_or_refused(version, changed, cut):
    content = packets.frame(version, 7, TIMES, {1: BODY, 2: BODY}, False)[4:]
    readable(read_frame, damaged(content, changed, cut), version)


@given(versions, changes, st.integers(0, 60))
@settings(max_examples=300, deadline=None)
def test_a_damaged_list_of_bodies_is_read_or_refused(version, changed, cut):
    content = packets.models(version, {1: "uam", 2: "box"})[4:]
    readable(read_models, damaged(content, changed, cut), version)


@given(versions, st.binary(max_size=300))
@settings(max_examples=300, deadline=None)
def test_any_bytes_are_read_or_refused(version, content):
    readable(read_frame, content, version)
    readable(read_models, content, version)


def test_counts_are_no_reason_to_read_beyond_the_end():
    """Four thousand million names, and as many numbers."""
    huge = (0xFFFFFFFF).to_bytes(4, "little")
    names = (1).to_bytes(4, "little") + bytes(4) + b"set\0" + huge
    with pytest.raises(UNREADABLE):
        read_models(names, Version(3, 1))
    empty = bytes(4 * 7)  # frame number; no marker sets, markers, bodies, skeletons, labeled
    plate = (1).to_bytes(4, "little") + bytes(4) + (1).to_bytes(4, "little") + huge
    with pytest.raises(UNREADABLE, match="bytes expected"):
        read_frame(empty[: 4 * 6] + plate, Version(3, 1))


@pytest.fixture
def driver():
    """A driver of a server with two bodies, and the server."""
    places = {"uam": (np.zeros(3), LEVEL), "box": (np.full(3, 2.0), LEVEL)}
    with MocapRoom([TrackedBody("uam"), TrackedBody("box")], lambda _: places) as server:
        source = NatNetSource("127.0.0.1", server.port)
        yield MocapDriver(MocapParameters(), load("motive_y_up"), source), server
        source.close()


def receive(driver, condition):
    found, end = [], time.monotonic() + PATIENCE
    while not condition(found):
        assert time.monotonic() < end, driver.health()
        found += driver.receive(0.02)
    return found


def unknown_models(version, names):
    """A kind of description that the package does not know."""
    content = (1).to_bytes(4, "little") + (99).to_bytes(4, "little")
    return packets.packet(packets.MODELS, content)


def test_after_a_change_of_the_bodies_no_pose_is_delivered_before_the_new_list(driver, monkeypatch):
    """The frame that announces the change may already have the new numbers."""
    driver, server = driver
    assert receive(driver, lambda found: len(found) > 5)[-1].position[0] == pytest.approx(0.0)
    monkeypatch.setattr(packets, "models", unknown_models)
    server.rename("uam", "spare")
    server.rename("box", "uam")
    receive(driver, lambda _: driver.health()[1].startswith("the list of bodies"))
    assert not [pose for _ in range(10) for pose in driver.receive(0.02)]
    monkeypatch.undo()
    found = receive(driver, lambda found: len(found) > 5)
    assert all(pose.position[0] == pytest.approx(2.0) for pose in found)


def test_a_list_that_cannot_be_read_is_said(driver, monkeypatch):
    driver, _ = driver
    monkeypatch.setattr(packets, "models", unknown_models)
    receive(driver, lambda _: driver.health()[1].startswith("the list of bodies"))
    level, text = driver.health()
    assert level is Level.ERROR and "Unknown data type 99" in text
    assert "stream rigid bodies only" in text
    monkeypatch.undo()
    receive(driver, lambda found: len(found) > 3)
