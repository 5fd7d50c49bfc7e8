"""The stand-in's own clock beside a simulator that comes early and late."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_sim_bridge.autopilot.server import LEAST, WITHIN, OwnClock

PERIOD = 0.004


class Steady:
    now = 100.0

    def __call__(self):
        return self.now


def test_samples_on_time_keep_the_simulators_spacing():
    steady = Steady()
    clock = OwnClock(steady)
    times = []
    for tick in range(100):
        steady.now = 100.0 + tick * PERIOD
        times.append(clock.time(7.0 + tick * PERIOD))
    assert times == pytest.approx([tick * PERIOD for tick in range(100)])


@given(
    st.lists(st.tuples(st.integers(1, 50), st.floats(0.002, 0.02)), min_size=1, max_size=20),
    st.floats(0.0, 1e4),
)
def test_a_stalled_simulator_does_not_stop_the_clock(spans, begin):
    """spans: so many samples, so far apart on the wall clock; 4 ms apart in the simulator."""
    steady = Steady()
    clock = OwnClock(steady)
    start, simulated, last = steady.now, begin, clock.time(begin)
    for count, pause in spans:
        for _ in range(count):
            steady.now += pause
            simulated += PERIOD
            found = clock.time(simulated)
            assert found >= last + LEAST - 1e-9
            assert abs(found - (steady.now - start)) <= WITHIN + 1e-6
            last = found


def test_after_half_a_second_without_samples():
    steady = Steady()
    clock = OwnClock(steady)
    clock.time(0.0)
    steady.now += 0.5
    assert clock.time(PERIOD) == pytest.approx(0.48, abs=0.01)
