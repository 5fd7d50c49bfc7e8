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


class Bus:
    """Servo cycles of given lengths [s] at 250 Hz; `begun`: when each began."""

    def __init__(self):
        self.now, self.begun = 0.0, []
        self.pace = PacedClock(PERIOD, steady=lambda: self.now, catch_up=math.inf)

    def run(self, *lengths):
        for cycle, length in enumerate(lengths):
            self.pace.note(cycle)
            self.begun.append(self.now)
            self.now += length
            self.now += self.pace.left(cycle + 1)
        return self.now


def test_bus_cycles_begin_at_absolute_deadlines():
    bus = Bus()
    bus.run(*[0.001, 0.003] * 50)
    assert bus.begun == pytest.approx([0.004 * k for k in range(100)])


def test_late_bus_cycles_do_not_lower_the_rate():
    """Three of four take longer than a period, but not on the average."""
    bus = Bus()
    assert bus.run(*[0.005, 0.005, 0.005, 0.001] * 50) == pytest.approx(0.8, abs=0.004)


def test_a_stalled_bus_is_not_made_up_for_by_a_burst():
    bus = Bus()
    bus.run(0.5, *[0.001] * 10)
    assert bus.begun[1:] == pytest.approx([0.5 + 0.004 * k for k in range(10)])
    assert bus.begun[0] == 0.0
