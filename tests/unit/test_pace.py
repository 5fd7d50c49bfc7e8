"""Stamps against the wall clock."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.ages import STALE
from uam_control.supervision.inputs import WINDOW, Pace, Waited


def run(pace, factor, seconds, stamp=0.0, wall=100.0):
    """Tick every 4 ms of simulated time at a real-time factor; return the last stamp and wall."""
    for _ in range(round(seconds / 0.004)):
        stamp, wall = stamp + 0.004, wall + 0.004 / factor
        pace.tick(stamp, wall)
    return stamp, wall


@given(st.floats(0.2, 2.0))
def test_a_constant_factor(factor):
    pace = Pace()
    run(pace, factor, 4.0)
    assert pace.slower == pytest.approx(1.0 - factor, abs=1e-6)


def test_unknown_before_a_window_has_passed():
    pace = Pace()
    assert math.isnan(pace.slower)
    run(pace, 1.0, WINDOW - 0.1)
    assert math.isnan(pace.slower)


def test_a_stall_counts_for_a_window():
    pace = Pace()
    stamp, wall = run(pace, 1.0, 3.0)
    pace.tick(stamp + 0.004, wall + 0.3)  # 0.3 s of the last second without progress
    assert pace.slower == pytest.approx(0.3, abs=0.01)
    run(pace, 1.0, 1.1, stamp + 0.004, wall + 0.3)
    assert pace.slower == pytest.approx(0.0, abs=0.01)


def test_a_new_simulation_begins_anew():
    pace = Pace()
    _, wall = run(pace, 0.5, 3.0)
    pace.tick(0.0, wall + 0.004)
    assert math.isnan(pace.slower)


@given(st.floats(0.11, 5.0), st.lists(st.floats(0.0, 0.09), max_size=20))
def test_ticks_that_waited_for_a_stopped_process_are_late(stopped, steps):
    """They come in bursts, the newest of each is a tick; one that has come in time is not late."""
    waited, wall, stamp = Waited(), 100.0, 0.0
    for _ in range(50):
        stamp, wall = stamp + 0.004, wall + 0.004
        assert not waited.late(stamp, wall)
    wall += stopped
    for step in steps:
        wall, stamp = wall + step, stamp + step + 0.03
        age = wall - 100.0 - stamp
        late = age if age > STALE else 0.0
        assert waited.late(stamp, wall) == pytest.approx(late) or abs(age - STALE) < 1e-6
    assert not waited.late(max(stamp, wall - 100.0), wall)


def test_no_tick_is_late_if_the_time_of_the_stamps_stood_still():
    waited, wall, stamp = Waited(), 100.0, 0.0
    found = []
    for tick in range(100):
        stamp, wall = stamp + 0.004, wall + (5.0 if tick == 10 else 0.004)
        found.append(waited.late(stamp, wall) > 0.0)
    assert not any(found[:10]) and sum(found) == pytest.approx(STALE / 0.004, abs=1)
    assert not any(found[40:]) and not waited.late(0.0, wall + 0.004 - stamp)
