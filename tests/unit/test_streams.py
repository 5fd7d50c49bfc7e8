"""StreamCheck: one request at a time, counted rates, bounded repetition, warnings."""

import pytest

from uam_control.offboard.modes import MavResult
from uam_sim_bridge.mavlink.protocol.wire import mavlink2
from uam_sim_bridge.mavlink.telemetry.streams import StreamCheck

ODOMETRY = mavlink2.MAVLINK_MSG_ID_ODOMETRY
HEARTBEAT = mavlink2.MAVLINK_MSG_ID_HEARTBEAT
BATTERY = mavlink2.MAVLINK_MSG_ID_BATTERY_STATUS
EXTENDED, ATTITUDE, STATUS, ESTIMATOR, CURRENT_MODE = 245, 31, 1, 230, 436
# message id → desired rate [Hz]; the heartbeat is counted, but not requested
RATES = {HEARTBEAT: 1, EXTENDED: 5, ATTITUDE: 10, ODOMETRY: 10, STATUS: 2, BATTERY: 1, ESTIMATOR: 2}
HIGHRES_IMU = mavlink2.MAVLINK_MSG_ID_HIGHRES_IMU
# CURRENT_MODE is requested, but not counted: an autopilot sends it on a change
REQUESTED = RATES | {CURRENT_MODE: 50, HIGHRES_IMU: 250}
WINDOW = 4.0  # s


def run(streams, seconds, start=0.0, rates=RATES, result=MavResult.ACCEPTED, answered=True):
    """Tick at 250 Hz with an autopilot that sends at `rates`; return (time, id) of the requests."""
    requests, due = [], dict.fromkeys(rates, start)
    for k in range(round(seconds / 0.004)):
        time = start + 0.004 * k
        for number, rate in rates.items():
            if rate and time >= due[number] - 1e-9:
                due[number] += 1.0 / rate
                streams.count(number, time)
        request = streams.request(time)
        if request:
            requests.append((round(time, 3), request[0]))
            assert request[1] == pytest.approx(1e6 / REQUESTED[request[0]])
            if answered:
                streams.answer(result)
    return requests


def test_each_stream_is_requested_once_without_a_warning():
    streams = StreamCheck()
    requests = run(streams, 10.0)
    assert [number for _, number in requests] == [
        EXTENDED,
        ATTITUDE,
        ODOMETRY,
        STATUS,
        BATTERY,
        ESTIMATOR,
        CURRENT_MODE,
    ]
    assert requests[-1][0] < 0.1
    assert streams.warnings == ()
    assert streams.rates[ODOMETRY] == pytest.approx(10.0, abs=0.5)


def test_a_mode_stream_that_a_station_switches_off_is_requested_again_within_a_second():
    streams = StreamCheck()
    run(streams, 6.0, rates=RATES | {CURRENT_MODE: 2})
    assert run(streams, 2.0, 6.0, rates=RATES | {CURRENT_MODE: 2}) == []
    again = [time for time, number in run(streams, 2.0, 8.0) if number == CURRENT_MODE]
    assert len(again) == 3 and again[0] < 9.0
    assert run(streams, 2.0, 10.0, rates=RATES | {CURRENT_MODE: 2}) == []


def test_a_further_stream_is_requested_and_counted():
    streams = StreamCheck({HIGHRES_IMU: 250.0})
    requests = run(streams, 10.0, rates=RATES | {HIGHRES_IMU: 120.0})
    assert HIGHRES_IMU in [number for _, number in requests]
    assert streams.warnings == ("HIGHRES_IMU received at 120.0 Hz, requested at 250 Hz",)


def test_the_next_request_waits_for_the_answer():
    times = [time for time, _ in run(StreamCheck(), 2.0, answered=False)]
    assert times[:3] == [0.0, 0.5, 1.0]


def test_a_slow_stream_is_requested_a_bounded_number_of_times():
    streams = StreamCheck()
    slow = RATES | {ODOMETRY: 1.0}
    requests = run(streams, 10 * WINDOW, rates=slow)
    assert [number for _, number in requests].count(ODOMETRY) == 3
    assert streams.warnings == ("ODOMETRY received at 1.0 Hz, requested at 10 Hz",)
    run(streams, 3 * WINDOW, start=10 * WINDOW)
    assert streams.warnings == ()  # the rate has recovered


def test_missing_streams_and_heartbeat_without_request():
    streams = StreamCheck()
    requests = run(streams, 3 * WINDOW, rates=RATES | {HEARTBEAT: 0.0, BATTERY: 0.0})
    assert HEARTBEAT not in [number for _, number in requests]
    assert "HEARTBEAT not received, requested at 1 Hz" in streams.warnings
    assert "BATTERY_STATUS not received, requested at 1 Hz" in streams.warnings


def test_refusals_are_warnings():
    streams = StreamCheck()
    requests = run(streams, 5 * WINDOW, result=MavResult.FAILED)
    assert len(requests) == 3 * 6 + 1  # CURRENT_MODE once
    assert "ODOMETRY received at 10.0 Hz, request for 10 Hz refused (failed)" in streams.warnings


def test_a_rate_above_half_of_the_desired_one_is_no_warning():
    streams = StreamCheck()
    run(
        streams,
        3 * WINDOW,
        rates={n: 0.7 * rate for n, rate in RATES.items()} | {HEARTBEAT: 1.0, BATTERY: 1.0},
    )
    assert streams.warnings == ()


def test_restart_requests_all_streams_again():
    streams = StreamCheck()
    run(streams, 1.0)
    streams.restart()
    assert len(run(streams, 1.0, start=1.0)) == 7


def test_an_answer_without_a_request_is_ignored():
    streams = StreamCheck()
    streams.answer(MavResult.DENIED)
    assert streams.warnings == ()


def test_an_autopilot_without_current_mode_is_no_warning():
    """PX4 before v1.15 refuses the request: the heartbeat then reports the mode alone."""
    streams = StreamCheck()
    requests = []
    for k in range(3000):
        time = 0.004 * k
        for number, rate in RATES.items():
            if k % round(250 / rate) == 0:
                streams.count(number, time)
        request = streams.request(time)
        if request:
            requests.append(request[0])
            refused = request[0] == CURRENT_MODE
            streams.answer(MavResult.UNSUPPORTED if refused else MavResult.ACCEPTED)
    assert requests.count(CURRENT_MODE) == 1 and streams.warnings == ()
