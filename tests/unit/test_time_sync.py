"""Clock offset and round trip with a simulated autopilot: delays, losses, reboots."""

import numpy as np
import pytest

from uam_sim_bridge.mavlink.telemetry.time_sync import BEHIND, RebootDetector, TimeSync, nanoseconds


def run(sync, seconds, start, offset, delay, back=None, lost=0.0, seed=1):
    """Tick at 250 Hz with an autopilot whose clock is `offset` [s] ahead; return its restarts.

    delay, back: one-way delays [s], numbers or callables; lost: fraction of requests.
    """
    noise = np.random.default_rng(seed)
    waiting, jumps = [], []
    sync.restart = lambda: (jumps.append(time), TimeSync.restart(sync))
    for k in range(round(seconds / 0.004)):
        time = start + 0.004 * k
        for arrival, tc1, ts1 in [w for w in waiting if w[0] <= time]:
            waiting.remove((arrival, tc1, ts1))
            sync.answer(time, tc1, ts1)
        ts1 = sync.request(time)
        if ts1 is not None and noise.random() >= lost:
            there = delay(noise) if callable(delay) else delay
            home = there if back is None else back
            waiting.append((time + there + home, nanoseconds(time + there + offset), ts1))
    return jumps


def test_no_estimate_before_the_first_answer():
    sync = TimeSync()
    assert sync.offset is None and sync.round_trip is None
    assert sync.request(0.0) == 1  # 0 would mark an answer
    assert sync.request(0.1) is None
    assert sync.request(0.2) == 200_000_000


def test_constant_delay():
    sync = TimeSync()
    assert run(sync, 5.0, 10.0, offset=123.4, delay=0.004) == []
    assert sync.offset == pytest.approx(123.4, abs=0.003)
    assert sync.round_trip == pytest.approx(0.008, abs=0.0041)


def test_the_shortest_round_trip_shows_a_slow_link_and_ignores_one_late_answer():
    sync = TimeSync()
    run(sync, 0.7, 10.0, offset=5.0, delay=0.004)
    assert sync.quickest is None  # too few answers
    run(sync, 2.0, 11.0, offset=5.0, delay=0.004)
    assert sync.quickest == pytest.approx(0.008, abs=0.0041)
    run(sync, 0.15, 13.1, offset=5.0, delay=0.05)  # one answer
    assert sync.quickest < 0.02
    run(sync, 1.3, 14.0, offset=5.0, delay=0.05)
    assert sync.quickest == pytest.approx(0.1, abs=0.0041) and sync.round_trip < 0.07


def test_random_delays_and_losses():
    sync = TimeSync()
    run(sync, 30.0, 20.0, offset=-7.0, delay=lambda n: n.exponential(0.02), back=0.002, lost=0.3)
    # the error of one answer is at most half the round trip, about 50 ms here
    assert sync.offset == pytest.approx(-7.0, abs=0.008)
    assert 0.01 < sync.round_trip < 0.06


def test_a_reboot_resets_at_once_and_only_once():
    sync = TimeSync()
    run(sync, 5.0, 0.0, offset=500.0, delay=0.004)
    jumps = run(sync, 5.0, 5.0, offset=-4.0, delay=0.004)
    assert len(jumps) == 1 and jumps[0] < 5.6  # three requests
    assert sync.offset == pytest.approx(-4.0, abs=0.003)


def test_a_single_outlier_is_ignored():
    sync = TimeSync()
    run(sync, 2.0, 0.0, offset=1.0, delay=0.0)
    ts1 = sync.request(2.0)
    sync.answer(2.004, ts1 + 10**12, ts1)
    run(sync, 1.0, 2.2, offset=1.0, delay=0.0)
    assert sync.offset == pytest.approx(1.0, abs=0.003)


def test_ticks_that_fall_behind_the_autopilots_clock_are_followed():
    sync = TimeSync()
    assert run(sync, 3.0, 1.0, offset=4.0, delay=0.004) == []
    assert len(run(sync, 3.0, 4.0, offset=6.5, delay=0.004)) == 1  # the ticks stood still for 2.5 s
    assert sync.offset == pytest.approx(6.5, abs=0.01)
    # and all the time: 0.8 times as fast as the autopilot's clock
    now = 7.0
    for _ in range(200):
        run(sync, 0.2, now, offset=6.5 + 0.25 * (now - 7.0), delay=0.004)
        now += 0.2
    assert sync.offset == pytest.approx(6.5 + 0.25 * (now - 7.0), abs=0.3)
    assert run(sync, 2.0, now, offset=0.0, delay=0.004)  # its clock began anew


def reboots(times):
    detector = RebootDetector()
    return [k for k, time in enumerate(times) if detector.time_since_boot(time)]


def test_a_reboot_is_a_time_since_boot_that_goes_back_for_good():
    before, after = list(np.arange(100.0, 105.0, 0.02)), list(np.arange(0.3, 3.0, 0.02))
    assert reboots(before + after) == [len(before) + BEHIND - 1]
    assert reboots(before + list(np.arange(104.2, 110.0, 0.02))) == []  # less than a second
    wrapped = list(np.arange(2**32 * 1e-3 - 1.0, 2**32 * 1e-3, 0.02))
    assert reboots(wrapped + after) == []  # 49.7 days in milliseconds


@pytest.mark.parametrize("late", [[101.0], [101.0, 101.02, 101.04, 101.06], [90.0, 95.0] * 4])
def test_packets_that_come_late_are_no_reboot(late):
    newer = list(np.arange(110.0, 111.0, 0.02))
    assert reboots([109.9, *late, *newer, *late, *newer]) == []
    between = [time for pair in zip(newer, late * 50, strict=False) for time in pair]
    assert reboots(between) == []


def test_a_slow_answer_is_no_jump():
    sync = TimeSync()
    run(sync, 2.0, 0.0, offset=1.0, delay=0.0)
    assert run(sync, 3.0, 2.0, offset=1.0, delay=0.6, back=0.0) == []


@pytest.mark.parametrize(("there", "back"), [(0.0, 1.1), (1.1, 0.0)])
def test_quick_answers_after_slow_ones_are_no_jump(there, back):
    sync = TimeSync()  # a link that begins with a second of messages in its buffers
    assert run(sync, 1.5, 0.0, offset=1.0, delay=there, back=back) == []
    assert abs(sync.offset - 1.0) > 0.5
    assert run(sync, 10.0, 1.5, offset=1.0, delay=0.002) == []
    assert sync.offset == pytest.approx(1.0, abs=0.02)


def test_answers_to_others_are_ignored():
    sync = TimeSync()
    ts1 = sync.request(1.0)
    sync.answer(1.0, 5, 77)
    assert sync.offset is None
    sync.answer(1.0, ts1 + 1000, ts1)
    offset = sync.offset
    sync.answer(1.0, 10**15, ts1)  # the same answer twice
    assert sync.offset == offset


def test_an_answer_in_the_tick_of_its_request_is_no_step_back():
    sync = TimeSync()
    for tick in range(1, 2001):  # a busy companion reads its clock once for both
        stamp = tick * 200_000_000 + 493_750
        ts1 = sync.request(stamp / 1e9)
        sync.answer(stamp / 1e9, ts1 + 1_500_000, ts1)
        assert sync.offset == pytest.approx(0.0015, abs=1e-6), tick
    assert sync.quickest == pytest.approx(0.001)


def test_a_new_simulation_discards_the_estimate():
    sync = TimeSync()
    run(sync, 2.0, 50.0, offset=1.0, delay=0.004)
    ts1 = sync.request(52.2)
    sync.answer(0.4, 10**9, ts1)
    assert sync.offset is None
