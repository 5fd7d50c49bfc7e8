"""Streams are asked for one by one, counted, asked for again boundedly and complained about."""

import pytest

from uam_sim_bridge.mavlink.protocol.modes import Result
from uam_sim_bridge.mavlink.protocol.wire import mavlink2
from uam_sim_bridge.mavlink.telemetry.streams import (
    ATTEMPTS,
    ONLY_COUNTED,
    RATES,
    WINDOW,
    StreamCheck,
)

ODOMETRY = mavlink2.MAVLINK_MSG_ID_ODOMETRY
HEARTBEAT = mavlink2.MAVLINK_MSG_ID_HEARTBEAT
BATTERY = mavlink2.MAVLINK_MSG_ID_BATTERY_STATUS


def run(streams, seconds, start=0.0, rates=RATES, result=Result.ACCEPTED, answered=True):
    """Tick at 250 Hz against an autopilot that sends at `rates`; return (time, id) asked."""
    asked, due = [], dict.fromkeys(rates, start)
    for k in range(round(seconds / 0.004)):
        time = start + 0.004 * k
        for number, rate in rates.items():
            if rate and time >= due[number] - 1e-9:
                due[number] += 1.0 / rate
                streams.count(number)
        request = streams.request(time)
        if request:
            asked.append((round(time, 3), request[0]))
            assert request[1] == pytest.approx(1e6 / RATES[request[0]])
            if answered:
                streams.answer(result)
    return asked


def test_each_is_asked_for_once_and_nothing_is_wrong():
    streams = StreamCheck()
    asked = run(streams, 10.0)
    assert [number for _, number in asked] == [n for n in RATES if n not in ONLY_COUNTED]
    assert asked[-1][0] < 0.1
    assert streams.warnings == ()
    assert streams.rates[ODOMETRY] == pytest.approx(10.0, abs=0.5)


def test_the_next_request_waits_for_the_answer():
    times = [time for time, _ in run(StreamCheck(), 2.0, answered=False)]
    assert times[:3] == [0.0, 0.5, 1.0]


def test_a_slow_stream_is_asked_for_again_boundedly():
    streams = StreamCheck()
    slow = RATES | {ODOMETRY: 1.0}
    asked = run(streams, 10 * WINDOW, rates=slow)
    assert [number for _, number in asked].count(ODOMETRY) == ATTEMPTS
    assert streams.warnings == ("ODOMETRY comes at 1.0 Hz, asked for 10 Hz",)
    run(streams, 3 * WINDOW, start=10 * WINDOW)
    assert streams.warnings == ()  # it comes after all


def test_silence_and_a_heartbeat_that_cannot_be_asked_for():
    streams = StreamCheck()
    asked = run(streams, 3 * WINDOW, rates=RATES | {HEARTBEAT: 0.0, BATTERY: 0.0})
    assert HEARTBEAT not in [number for _, number in asked]
    assert "HEARTBEAT does not come, asked for 1 Hz" in streams.warnings
    assert "BATTERY_STATUS does not come, asked for 1 Hz" in streams.warnings


def test_refusals_are_said():
    streams = StreamCheck()
    asked = run(streams, 5 * WINDOW, result=Result.FAILED)
    assert len(asked) == ATTEMPTS * (len(RATES) - len(ONLY_COUNTED))
    assert "ODOMETRY comes at 10.0 Hz, 10 Hz were refused (failed)" in streams.warnings


def test_somewhat_slow_is_enough():
    streams = StreamCheck()
    run(
        streams,
        3 * WINDOW,
        rates={n: 0.7 * rate for n, rate in RATES.items()} | {HEARTBEAT: 1.0, BATTERY: 1.0},
    )
    assert streams.warnings == ()


def test_restart_asks_anew():
    streams = StreamCheck()
    run(streams, 1.0)
    streams.restart()
    assert len(run(streams, 1.0, start=1.0)) == len(RATES) - len(ONLY_COUNTED)


def test_an_answer_to_nobody_is_ignored():
    streams = StreamCheck()
    streams.answer(Result.DENIED)
    assert streams.warnings == ()
