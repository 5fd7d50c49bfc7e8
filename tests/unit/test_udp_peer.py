"""The stand-in's UDP port answers its first peer, until that peer is silent."""

import socket

import pytest

from uam_sim_bridge import paced_clock
from uam_sim_bridge.mavlink.hil.sitl_ports import SILENT, UdpPort
from uam_sim_bridge.mavlink.protocol.wire import Codec, mavlink2

HEARTBEAT = mavlink2.MAVLink_heartbeat_message(18, 8, 0, 0, 0, 3)


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(paced_clock.time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def peers():
    made = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for one in made:
        one.bind(("127.0.0.1", 0))
        one.settimeout(10.0)
    yield made
    for one in made:
        one.close()


def test_the_peer_is_replaced_after_its_silence_alone(clock, peers):
    first, second = peers
    port = UdpPort(0, 9, Codec(1, 1))
    own = ("127.0.0.1", socket.socket(fileno=socket.dup(port.fileno())).getsockname()[1])

    def heard(sender):
        sender.sendto(Codec(255, 190).encode(HEARTBEAT), own)
        return len(port.receive())

    assert heard(first) == 1
    assert heard(second) == 0
    clock[0] += 1000.0  # the simulation stood still: half a second counts
    assert heard(second) == 0
    for _ in range(round(SILENT / 0.25)):
        clock[0] += 0.25
        port.receive()
    assert heard(second) == 1
    assert heard(first) == 0
    port.send([HEARTBEAT])
    assert second.recv(1000)
    port.close()
