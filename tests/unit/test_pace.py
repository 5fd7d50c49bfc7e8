"""How much slower than the wall clock a simulation runs."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.supervision.pace import WINDOW, Pace


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
