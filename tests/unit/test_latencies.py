"""Latencies of the plant in real time: answered, late, missed, still on its way."""

import pytest

from uam_sim_bridge.nodes.latencies import Latencies
from uam_sim_bridge.nodes.plant_options import Statistics

PERIOD, MS = 0.004, 1_000_000


def test_setpoints_are_judged_by_the_sample_that_they_answer():
    numbers = Statistics("realtime")
    latencies = Latencies(numbers, PERIOD)
    latencies.tick(None, 0, {})  # no sample yet, nothing to answer
    latencies.tick(4 * MS, 0, {})
    latencies.tick(8 * MS, 4 * MS, {4 * MS: 2 * MS})
    # late, its stamp with jitter; and one that answers no sample of ours
    latencies.tick(12 * MS, 8 * MS, {8 * MS + 1000: 9 * MS, 396 * MS: 0})
    latencies.tick(16 * MS, 12 * MS, {12 * MS: 21 * MS})  # beyond three periods
    assert list(numbers.latency_s) == pytest.approx([0.002, 0.005, 0.013])
    assert (numbers.answerable_ticks, numbers.late_ticks, numbers.missed_ticks) == (4, 2, 1)


def test_what_was_never_answered_counts_at_the_end_but_not_what_is_on_its_way():
    numbers = Statistics("realtime")
    latencies = Latencies(numbers, PERIOD)
    latencies.tick(1, 0, {})
    latencies.tick(2, 40 * MS, {})
    latencies.conclude(41 * MS)
    assert (numbers.late_ticks, numbers.missed_ticks) == (1, 1)
    latencies.conclude(400 * MS)  # a second call counts nothing twice
    assert numbers.missed_ticks == 1
