"""Deadlines of ticks by the wall clock: on time, after jitter, after a stall."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_sim_bridge.nodes.tick_deadlines import CATCH_UP, TickDeadlines

PERIOD = 0.004


def flown(lateness: list[float], let_go: float) -> tuple[float, TickDeadlines]:
    """Return the time [s] at which the last tick begins, each `lateness` [s] after its deadline."""
    deadlines, begun = TickDeadlines(PERIOD, let_go), 0.0
    for tick, late in enumerate(lateness, 1):
        begun = deadlines.next(0.0, tick, begun, begun) + late
    return begun, deadlines


def test_a_tick_on_time_begins_one_period_later():
    assert TickDeadlines(PERIOD, 0.02).next(1.0, 5, 1.016, 1.017) == pytest.approx(1.02)


def test_a_stall_is_caught_up_without_a_burst_or_let_go():
    late = TickDeadlines(PERIOD, 0.0)  # 0.1 s behind the due time of 1.02 s
    assert late.next(1.0, 5, 1.12, 1.12) == pytest.approx(1.12 + PERIOD / CATCH_UP)
    assert late.lost == 0.0
    late = TickDeadlines(PERIOD, 0.02)
    assert late.next(1.0, 5, 1.115, 1.12) == pytest.approx(1.12)
    assert late.lost == pytest.approx(0.1)
    assert late.next(1.0, 6, 1.12, 1.121) == pytest.approx(1.124)  # in time from now on


@given(st.lists(st.floats(0.0, 0.0007), min_size=50, max_size=200), st.sampled_from([0.0, 0.02]))
def test_a_little_lateness_of_every_tick_does_not_add_up(lateness, let_go):
    """A wake-up is always a little late; the flight keeps real time nevertheless."""
    end, deadlines = flown(lateness, let_go)
    assert end <= len(lateness) * PERIOD + 0.0007 + 1e-9
    assert deadlines.lost == 0.0
