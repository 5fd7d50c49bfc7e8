"""Latency from a tick's IMU sample to its setpoint, in real time."""

import pytest

from uam_sim_bridge.nodes.latencies import Latencies
from uam_sim_bridge.nodes.plant_options import Statistics

PERIOD = 4_000_000  # [ns]


def flown(beside, taken, lost=()):
    """The statistics of 100 ticks; beside: of the stack's stamps [ns], taken: latency [ns]."""
    numbers = Statistics("realtime")
    latencies = Latencies(numbers, PERIOD * 1e-9)
    for k in range(100):
        stamp = k * PERIOD
        latencies.tick(stamp, stamp, {stamp + beside(k): stamp + taken} if k not in lost else {})
    latencies.conclude(100 * PERIOD + 10**9)
    return numbers


@pytest.mark.parametrize(
    "beside",
    [
        lambda k: 0,
        lambda k: 1_999_999,
        lambda k: 2_000_000 + (-1) ** k * 200_000,
        lambda k: -3_000_000,
    ],
)
def test_every_setpoint_has_its_sample_whatever_the_offset_of_the_clocks(beside):
    numbers = flown(beside, 1_500_000)
    assert numbers.answerable_ticks == 100
    assert len(numbers.latency_s) >= 99  # beside the grid the last may have no sample yet
    assert numbers.missed_ticks <= 1 and max(numbers.latency_s) < 0.006


def test_lost_setpoints_are_missed_and_slow_ones_late():
    assert flown(lambda k: 0, 1_000_000, lost=(5, 50)).missed_ticks == 2
    slow = flown(lambda k: 0, 5_000_000)
    assert (slow.late_ticks, slow.missed_ticks) == (100, 0)
    assert flown(lambda k: 0, 13_000_000).missed_ticks == 100


def test_a_setpoint_twice_counts_once():
    latencies = Latencies(numbers := Statistics("realtime"), PERIOD * 1e-9)
    latencies.tick(0, 0, {})
    latencies.tick(PERIOD, PERIOD, {PERIOD: PERIOD + 1_000_000})
    latencies.tick(None, 0, {PERIOD: PERIOD + 2_000_000})
    assert numbers.latency_s == pytest.approx([0.001])
