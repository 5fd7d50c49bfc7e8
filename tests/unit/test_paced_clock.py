"""Ticks paced by the wall clock in a realtime flight: on time, after jitter, after a stall."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_sim_bridge.nodes.mujoco_sim import CATCH_UP
from uam_sim_bridge.paced_clock import PacedClock

PERIOD = 0.004


class Steady:
    """A clock that the test sets [s]."""

    def __init__(self) -> None:
        self.now = 1.0

    def __call__(self) -> float:
        return self.now


def begun(latest: float) -> tuple[PacedClock, Steady]:
    steady = Steady()
    clock = PacedClock(PERIOD, steady, catch_up=CATCH_UP, latest=latest)
    clock.begin()
    return clock, steady


def test_a_tick_on_time_begins_one_period_later():
    clock, steady = begun(0.02)
    steady.now = 1.016
    clock.note(4)
    assert clock.deadline(5) == pytest.approx(1.02)


def test_a_stall_is_caught_up_without_a_burst_or_let_go():
    clock, steady = begun(math.inf)
    steady.now = 1.12  # 0.1 s behind the due time of 1.02 s
    clock.note(5)
    assert clock.deadline(6) == pytest.approx(1.12 + PERIOD / CATCH_UP)
    assert clock.lost == 0.0
    clock, steady = begun(0.02)
    steady.now = 1.12
    clock.note(5)
    assert clock.lost == pytest.approx(0.1)
    assert clock.deadline(6) == pytest.approx(1.124)  # in time from now on


@given(
    st.lists(st.floats(0.0, 0.0007), min_size=50, max_size=200), st.sampled_from([math.inf, 0.02])
)
def test_a_little_lateness_of_every_tick_does_not_add_up(lateness, latest):
    """A wake-up is always a little late; the flight keeps real time nevertheless."""
    clock, steady = begun(latest)
    clock.note(0)
    for tick, late in enumerate(lateness, 1):
        steady.now = clock.deadline(tick) + late
        clock.note(tick)
    assert steady.now - 1.0 <= len(lateness) * PERIOD + 0.0007 + 1e-9
    assert clock.lost == 0.0
