"""Send queue of a slow line, pacing, and thinning of HIL_SENSOR."""

import pytest

from uam_sim_bridge.mavlink.hil.router import Thinner, sustainable_rate
from uam_sim_bridge.mavlink.protocol.wire import mavlink2
from uam_sim_bridge.mavlink.transport.pacing import Meter, Outbox, Pacer


class Line:
    """A transport that accepts `room` frames."""

    stream = True

    def __init__(self, bytes_per_second=None, room=10_000):
        self.bytes_per_second, self.room = bytes_per_second, room
        self.connected, self.sent = True, []

    def send(self, data):
        if not self.connected or self.room <= 0:
            return False
        self.room -= 1
        self.sent.append(data)
        return True


def test_urgent_frames_overtake_when_the_line_is_full():
    line = Line(room=0)
    box = Outbox(line)
    for kind in ("HEARTBEAT", "HIL_SENSOR", "PARAM_SET", "SET_ATTITUDE_TARGET"):
        box.put(kind, kind.encode())
    assert box.flush(0.0) == 0 and box.wait == 0.0
    line.room = 3
    assert box.flush(0.0) == len("HIL_SENSORSET_ATTITUDE_TARGETHEARTBEAT")
    assert line.sent == [b"HIL_SENSOR", b"SET_ATTITUDE_TARGET", b"HEARTBEAT"]
    assert box.wait is not None and box.dropped == 0


def test_the_newest_urgent_frames_are_kept():
    line = Line(room=0)
    box = Outbox(line)
    for k in range(100):
        box.put("HIL_SENSOR", b"s%d" % k)
        box.put("HEARTBEAT", b"h%d" % k)
    assert box.dropped == 200 - 8 - 64  # lengths of the two queues
    line.room = 1000
    box.flush(0.0)
    assert line.sent[7] == b"s99" and line.sent[-1] == b"h99"
    assert len(line.sent) == 72 and box.wait is None


def test_pacing_limits_the_rate_and_the_delay_of_urgent_frames():
    line = Line(bytes_per_second=10_000.0)
    box = Outbox(line)
    delays, seconds = [], 4.0
    for k in range(4000):
        time = 0.001 * k
        box.put("PARAM_VALUE", bytes(100))
        if k % 4 == 0:
            box.put("HIL_SENSOR", b"%04d" % k)
        seen = len(line.sent)
        box.flush(time)
        delays += [time - 0.001 * int(s) for s in line.sent[seen:] if len(s) == 4]
    assert 0.9 * seconds <= sum(map(len, line.sent)) / 1e4 <= seconds + 0.02  # a burst of 10 ms
    assert (
        len(delays) >= 995 and max(delays) < 0.0125
    )  # at most one other frame and the burst before it


def test_a_lost_line_drops_queued_frames():
    line = Line(room=0)
    box = Outbox(line)
    box.put("HIL_SENSOR", b"old")
    line.connected = False
    box.flush(0.0)
    line.connected, line.room = True, 10
    box.flush(1.0)
    assert line.sent == [] and box.dropped == 1


def test_pacer_without_a_rate_has_no_limit():
    pacer = Pacer(None)
    pacer.sent(10**9)
    assert pacer.may_send(0.0) and pacer.wait == 0.0


def test_meter():
    meter = Meter(window=2.0)
    assert not meter.update(5.0)
    meter.add(300)
    assert not meter.update(6.9) and meter.update(7.0) and meter.rate == 150.0
    assert meter.update(9.0) and meter.rate == 0.0 and meter.highest == 150.0


def sensor(k, fields):
    return mavlink2.MAVLink_hil_sensor_message(4000 * k, *[0.0] * 13, fields, 0)


@pytest.mark.parametrize(("rate", "passed"), [(250.0, 500), (125.0, 250), (200.0, 400), (1e3, 500)])
def test_thinning_keeps_the_rate_and_loses_no_slow_sensor(rate, passed):
    thinner = Thinner(rate)
    fields = [0x3F | (0x1C0 if k % 5 == 0 else 0) for k in range(500)]
    taken = [m for m in (sensor(k, f) for k, f in enumerate(fields)) if thinner.take(m)]
    assert len(taken) == pytest.approx(passed, abs=2)
    assert sum(m.fields_updated & 0x1C0 != 0 for m in taken) == pytest.approx(100, abs=1)
    assert all(m.fields_updated & 0x3F == 0x3F for m in taken)


def test_thinning_restarts_with_the_simulator():
    thinner = Thinner(100.0)
    assert thinner.take(sensor(10_000, 1)) and thinner.take(sensor(0, 1))


def test_rate_from_the_baud():
    assert sustainable_rate(None) == sustainable_rate(92160.0) == 250.0
    assert 200.0 < sustainable_rate(46080.0) < 250.0
    with pytest.raises(ValueError, match="do not carry"):
        sustainable_rate(11520.0)
