"""FaultyTransport loses, delays and corrupts packets as scheduled, and changes no others."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from uam_control.mission import load_scenario
from uam_sim_bridge.faults import read_schedule
from uam_sim_bridge.faults.faulty_plant import DirectFaults
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2
from uam_sim_bridge.mavlink.transport.faulty_transport import FaultyTransport

SCENARIO = load_scenario("hover")
HEARTBEAT = mavlink2.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3)


class Line:
    """A transport without faults."""

    stream, bytes_per_second, connected, dropped = False, None, True, 0

    def __init__(self):
        self.sent: list[bytes] = []
        self.arriving: list[bytes] = []
        self.closed = False

    def send(self, data):
        self.sent.append(data)
        return True

    def receive(self):
        taken, self.arriving = self.arriving, []
        return taken

    def fileno(self):
        return 7

    def close(self):
        self.closed = True


def faulty(*texts):
    line = Line()
    transport = FaultyTransport(line, read_schedule(texts, SCENARIO, 1))
    transport.timeline.mission_at(10.0, 0.0, "take-off")
    return line, transport


def test_a_cut_lasts_from_its_beginning_to_its_end():
    line, transport = faulty("mavlink_cut@1+2")
    changes = []
    for second in range(5):
        changes += [(c.active, second) for c in transport.update(10.0 + second)]
        assert transport.send(b"%d" % second)
        line.arriving.append(b"%d" % second)
        arrived = transport.receive()
        assert arrived == ([] if second in (1, 2) else [b"%d" % second])
    assert line.sent == [b"0", b"3", b"4"]
    assert changes == [(True, 1), (False, 3)]


def test_a_fault_of_one_direction_leaves_the_other_unchanged():
    for direction, sent, arrived in (("to_autopilot", [], [b"x"]), ("from_autopilot", [b"y"], [])):
        line, transport = faulty(f"mavlink_cut@0:direction={direction}")
        transport.update(10.0)
        transport.send(b"y")
        line.arriving.append(b"x")
        assert (line.sent, transport.receive()) == (sent, arrived)


@given(st.lists(st.floats(0.0, 0.3), min_size=1, max_size=30))
def test_delayed_packets_arrive_later_in_order_and_complete(steps):
    line, transport = faulty("mavlink_delay@0+1:delay=0.1")
    now, begun, arrived = 10.0, [], []
    for step in [*steps, 1.0]:
        now += step
        transport.update(now)
        begun.append(now)
        transport.send(b"%d" % len(begun))
        arrived += [now] * (len(line.sent) - len(arrived))
    transport.update(now + 1.0)
    assert line.sent == [b"%d" % number for number in range(1, len(begun) + 1)]
    for start, end in zip(begun, arrived, strict=False):
        assert end - start >= (0.1 - 1e-6 if start < 11.0 - 1e-6 else 0.0)


def test_a_corrupted_packet_is_another_and_is_not_used():
    line, transport = faulty("mavlink_corruption@0:share=0.5")
    transport.update(10.0)
    codec = Codec(1, 191)
    frame = codec.encode(HEARTBEAT)
    for _ in range(200):
        transport.send(frame)
    corrupted = [data for data in line.sent if data != frame]
    assert len(line.sent) == 200 and 60 < len(corrupted) < 140
    assert all(len(data) == len(frame) for data in corrupted)
    framer = Framer(Codec(1, 191))
    assert sum(len(framer.datagram(data)) for data in corrupted) == 0


def test_other_members_are_those_of_the_wrapped_transport():
    line, transport = faulty("mavlink_cut@1")
    assert (transport.stream, transport.connected, transport.fileno()) == (False, True, 7)
    transport.close()
    assert line.closed


def test_the_direct_engine_skips_what_a_cut_or_corruption_loses():
    link = DirectFaults(
        read_schedule(["mavlink_cut@1+1", "mavlink_corruption@3+1:share=0.5"], SCENARIO, 1)
    )
    link.timeline.mission_at(0.0, 0.0, "take-off")
    passed = {}
    for second in range(5):
        link.timeline.update(float(second))
        passed[second] = sum(link.passes() for _ in range(100))
    assert (passed[0], passed[1], passed[2], passed[4]) == (100, 0, 100, 100)
    assert 30 < passed[3] < 70
