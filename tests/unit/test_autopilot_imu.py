"""The autopilot's IMU: frames, stamps of the companion's clock, unusable samples."""

import numpy as np
import pytest

from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.telemetry import Telemetry
from uam_sim_bridge.mavlink.protocol.wire import Codec, mavlink2
from uam_sim_bridge.mavlink.telemetry.time_sync import (
    FRESH,
    SLEW,
    AutopilotImu,
    ClockMap,
    TimeSync,
    nanoseconds,
)

BOOT = 1_700_000_000.25  # [s] companion's clock when the autopilot's began
NUMBER = mavlink2.MAVLINK_MSG_ID_HIGHRES_IMU


def message(microseconds, gyro=(0.1, 0.2, 0.3), force=(1.0, 2.0, -9.0), fields=FRESH, number=0):
    made = mavlink2.MAVLink_highres_imu_message(
        microseconds, *force, *gyro, *[0.0] * 7, fields, number
    )
    return Codec(2, 1).decode(Codec(1, 1).encode(made))


def synchronised(delays, start=BOOT + 5.0, drift=0.0):
    """A TimeSync after answers with delays [s] there and back; five a second."""
    sync, time = TimeSync(), start
    for there, back in delays:
        ts1 = sync.request(time)
        at = time + there
        sync.answer(at + back, nanoseconds((at - BOOT) * (1.0 + drift)), ts1)
        time += 0.2
    return sync


def test_frd_becomes_flu_and_boot_time_the_companions_clock():
    imu = AutopilotImu(synchronised([(0.001, 0.001)] * 5))
    imu.take(message(7_004_000))
    (sample,) = imu.samples()
    assert sample.stamp == pytest.approx((BOOT + 7.004) * 1e9, abs=1000)
    np.testing.assert_allclose(sample.gyro, [0.1, -0.2, -0.3], rtol=1e-7)
    np.testing.assert_allclose(sample.force, [1.0, -2.0, 9.0], rtol=1e-7)
    assert imu.samples() == []


@pytest.mark.parametrize("answers", [0, 1, 4])
def test_nothing_is_delivered_before_the_clocks_are_related(answers):
    imu = AutopilotImu(synchronised([(0.001, 0.001)] * answers))
    imu.take(message(7_000_000))
    assert imu.samples() == [] and imu.refused == 0


def test_nor_after_a_reboot():
    sync = synchronised([(0.001, 0.001)] * 5)
    imu = AutopilotImu(sync)
    sync.restart()
    imu.take(message(1_000))
    assert imu.samples() == []


@pytest.mark.parametrize(
    "bad",
    [
        {"fields": 0x07},
        {"fields": 0x38},
        {"number": 1},
        {"gyro": (0.0, np.nan, 0.0)},
        {"force": (np.inf, 0.0, 0.0)},
    ],
)
def test_a_sample_that_cannot_be_used_is_counted(bad):
    imu = AutopilotImu(synchronised([(0.001, 0.001)] * 5))
    imu.take(message(7_000_000, **bad))
    assert imu.samples() == [] and imu.refused == 1


def test_unequal_ways_shift_the_stamps_by_half_their_difference():
    sync = synchronised([(0.003, 0.001)] * 5)
    assert ClockMap(sync).companion(0) == pytest.approx((BOOT - 0.001) * 1e9, abs=1000)


def test_stamps_wander_less_than_the_delays_and_follow_a_drift():
    random = np.random.default_rng(3)
    delays = [(0.0005 + d, 0.0005 + e) for d, e in random.exponential(0.002, (300, 2))]
    sync = synchronised(delays, drift=20e-6)
    uptime = 5.0 + 0.2 * 300
    stamp = ClockMap(sync).companion(nanoseconds(uptime * (1.0 + 20e-6)))
    assert stamp == pytest.approx((BOOT + uptime) * 1e9, abs=0.5e6)


def test_a_better_answer_lets_no_stamp_go_back():
    sync = synchronised([(0.06, 0.0)] * 5)
    clocks = ClockMap(sync)
    stamps = [clocks.companion(0)]
    sync.offset -= 0.03  # the error of the slow answers
    stamps += [clocks.companion(4_000_000 * k) for k in range(1, 1000)]
    steps = np.diff(stamps)
    assert steps.min() >= 4_000_000 - SLEW and steps.max() <= 4_000_000 + SLEW
    assert stamps[-1] == 4_000_000 * 999 - round(sync.offset * 1e9)


def test_the_stand_in_sends_its_sample_on_request_only():
    autopilot = Autopilot()
    telemetry = Telemetry(autopilot)
    gyro, force = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, -9.0])
    sent = []
    for k in range(1, 501):
        if k == 251:
            assert telemetry.set_interval(NUMBER, 4000.0)
        autopilot.update(0.004 * k, gyro, force)
        sent += [m for m in telemetry.due(0.004 * k) if m.get_msgId() == NUMBER]
    assert [m.time_usec for m in sent] == [4000 * k for k in range(251, 501)]
    assert (sent[0].xgyro, sent[0].ygyro, sent[0].zgyro) == (0.1, 0.2, 0.3)
    assert (sent[0].xacc, sent[0].yacc, sent[0].zacc) == (1.0, 2.0, -9.0)
    assert sent[0].fields_updated == FRESH
