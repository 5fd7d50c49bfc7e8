"""Latencies of the plant in real time: answered, late, missed, still on its way."""

import pytest

from uam_sim_bridge.nodes.plant_health import MOST_UNANSWERED, Statistics

PERIOD, MS = 0.004, 1_000_000
TICK = 4 * MS


def test_setpoints_are_judged_by_the_sample_that_they_answer():
    numbers = Statistics("realtime", PERIOD)
    numbers.tick(None, 0, {})  # no sample yet, nothing to answer
    numbers.tick(4 * MS, 0, {})
    numbers.tick(8 * MS, 4 * MS, {4 * MS: 2 * MS})
    # late, its stamp with jitter; and one that answers no sample of ours
    numbers.tick(12 * MS, 8 * MS, {8 * MS + 1000: 9 * MS, 396 * MS: 0})
    numbers.tick(16 * MS, 12 * MS, {12 * MS: 21 * MS})  # beyond three periods
    assert list(numbers.latency_s) == pytest.approx([0.002, 0.005, 0.013])
    assert (numbers.answerable_ticks, numbers.late_ticks, numbers.missed_ticks) == (4, 2, 1)


def test_what_was_never_answered_counts_at_the_end_but_not_what_is_on_its_way():
    numbers = Statistics("realtime", PERIOD)
    numbers.tick(1, 0, {})
    numbers.tick(2, 40 * MS, {})
    numbers.conclude(41 * MS)
    assert (numbers.late_ticks, numbers.missed_ticks) == (1, 1)
    numbers.conclude(400 * MS)  # a second call counts nothing twice
    assert numbers.missed_ticks == 1


def flown(beside, taken, lost=()):
    """The statistics of 100 ticks; beside: of the stack's stamps [ns], taken: latency [ns]."""
    numbers = Statistics("realtime", PERIOD)
    for k in range(100):
        stamp = k * TICK
        numbers.tick(stamp, stamp, {stamp + beside(k): stamp + taken} if k not in lost else {})
    numbers.conclude(100 * TICK + 1000 * MS)
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
    numbers = Statistics("realtime", PERIOD)
    numbers.tick(0, 0, {})
    numbers.tick(TICK, TICK, {TICK: TICK + MS})
    numbers.tick(None, 0, {TICK: TICK + 2 * MS})
    assert numbers.latency_s == pytest.approx([0.001])


def test_samples_of_hours_without_a_companion_are_not_kept():
    numbers = Statistics("realtime", PERIOD)
    for k in range(3 * MOST_UNANSWERED):
        numbers.tick(k * 4_000_000, k * 4_000_000, {})
    assert len(numbers._unanswered) == MOST_UNANSWERED
    numbers.conclude(10**12)
    assert numbers.missed_ticks == numbers.late_ticks == 3 * MOST_UNANSWERED
