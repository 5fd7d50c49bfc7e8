"""The server's clock from one-way messages, and the counting of frames."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_sim_bridge.devices.mocap.driver import DRIFT_MAX, RESTART, ClockOffset, FrameCount

RATE = 120.0


def messages(count, offset, drift, delays, begun=1000.0):
    """(sent by the server's clock, arrival by the host's) with these delays [s] of the network."""
    sent = begun + np.arange(count) / RATE
    return zip(sent, sent + offset + drift * (sent - begun) + delays, strict=True)


@given(st.floats(-1e4, 1e9), st.floats(-1e-4, 1e-4), st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_offset_and_drift_are_found_below_the_jitter(offset, drift, seed):
    count, least = 3000, 1e-4
    delays = least + np.random.default_rng(seed).exponential(2e-3, count)
    clock = ClockOffset()
    for sent, arrival in messages(count, offset, drift, delays):
        clock.add(sent, arrival)
    last = 1000.0 + (count - 1) / RATE
    true = last + offset + drift * (last - 1000.0)
    assert clock.jumps == 0
    assert clock.host(last) - true == pytest.approx(least, abs=2e-4)
    assert clock.drift == pytest.approx(drift, abs=3e-5)


def test_the_first_message_gives_an_offset_and_an_earlier_one_corrects_it():
    clock = ClockOffset()
    assert clock.value is None
    clock.add(10.0, 15.050)
    assert clock.host(10.0) == pytest.approx(15.050)
    clock.add(10.1, 15.102)
    assert clock.host(10.1) == pytest.approx(15.102)
    clock.add(10.2, 15.240)  # late by 38 ms: no new knowledge
    assert clock.host(10.2) == pytest.approx(15.202)


@pytest.mark.parametrize("step", [-3.0, 0.5, 40.0])
def test_a_clock_that_was_set_is_followed_within_two_blocks(step):
    clock = ClockOffset()
    for sent, arrival in messages(600, 5.0, 0.0, np.zeros(600)):
        clock.add(sent, arrival)
    assert clock.jumps == 0
    after = list(messages(300, 5.0 + step, 0.0, np.zeros(300), begun=1005.0))
    for sent, arrival in after:
        clock.add(sent, arrival)
    assert clock.jumps >= 1
    assert clock.value == pytest.approx(5.0 + step, abs=1e-6)


def test_a_server_that_counts_from_zero_is_a_new_clock():
    clock = ClockOffset()
    for sent, arrival in messages(600, 5.0, 0.0, np.zeros(600)):
        clock.add(sent, arrival)
    clock.add(0.0, 1010.0)
    assert clock.jumps == 1 and clock.value == pytest.approx(1010.0)


def test_the_drift_is_bounded():
    clock = ClockOffset()
    for sent, arrival in messages(3000, 0.0, 2e-3, np.zeros(3000)):
        clock.add(sent, arrival)
    assert abs(clock.drift) <= DRIFT_MAX


def taken(numbers):
    count = FrameCount()
    return count, [number for number in numbers if count.take(number)]


def test_gaps_are_losses_and_repeats_are_discarded():
    count, found = taken([5, 6, 6, 9, 9, 10])
    assert found == [5, 6, 9, 10]
    assert (count.received, count.lost, count.repeated, count.late) == (4, 2, 2, 0)


def test_a_late_frame_is_no_loss_but_is_discarded():
    count, found = taken([1, 3, 2, 2, 4])
    assert found == [1, 3, 4]
    assert (count.received, count.lost, count.repeated, count.late) == (3, 0, 1, 1)


def test_a_server_that_counts_anew_is_followed():
    count, found = taken([1000, 1001, 1, 2])
    assert found == [1000, 1001, 1, 2] and count.lost == 0
    count.restart()
    assert count.take(1) and count.lost == 0


@given(st.lists(st.integers(0, RESTART - 1), max_size=60))
def test_what_is_taken_grows_and_every_number_is_accounted_for(numbers):
    count, found = taken(numbers)
    assert found == sorted(set(found))
    assert count.received == len(found)
    assert count.received + count.repeated + count.late == len(numbers)
    if found:
        span = set(range(found[0], found[-1] + 1))
        assert count.lost == len(span - set(numbers))
