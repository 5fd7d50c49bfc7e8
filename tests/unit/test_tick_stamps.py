"""Ticks lie one control period apart, also when the stamps of the IMU do not."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from settled_join import SettledJoin

from uam_control.stages.tick_stamps import LONG, TickStamps, follows, next_stamp, serves
from uam_msgs_py.node.joins import Ahead

PERIOD = 4_000_000
MS = 1_000_000


def ticks_of(samples):
    ticks = TickStamps(PERIOD)
    memory, window = ticks.memory, ticks.window
    return [next_stamp(memory, window, one) for one in samples if follows(memory, one)], ticks


@given(st.integers(0, 10**12), st.lists(st.integers(1, 9), max_size=60))
def test_exact_stamps_are_not_changed(first, steps):
    samples = [int(s) for s in first + PERIOD * np.cumsum([0, *steps])]
    found, ticks = ticks_of(samples)
    assert found == samples
    assert ticks.missing == sum(step - 1 for step in steps)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.2, 1.0, 1.9]))
def test_jitter_up_to_half_a_period_repeats_and_losses_change_no_tick(seed, jitter):
    random = np.random.default_rng(seed)
    grid = PERIOD * np.arange(1, 500)
    late = random.uniform(-jitter * MS, jitter * MS, len(grid)).astype(int)
    late[0] = 0  # the grid is that of the first sample
    if jitter > 1.0:
        kept = np.ones(len(grid), dtype=bool)
    else:
        kept = random.random(len(grid)) > 0.01
        kept[0] = True
    samples = []
    for stamp in (grid + late)[kept]:
        samples += [int(stamp)] * (1 + (random.random() < 0.01))
    found, ticks = ticks_of(samples)
    assert found == grid[kept].tolist()
    assert ticks.repeated == len(samples) - kept.sum()


@pytest.mark.parametrize("drift", [-200e-6, 200e-6])
def test_drifting_clocks_are_followed_without_a_lost_tick(drift):
    samples = np.round(PERIOD * (1.0 + drift) * np.arange(1, 50_000)).astype(int).tolist()
    found, ticks = ticks_of(samples)
    assert len(found) == len(samples) and ticks.missing == 0
    assert np.abs(np.subtract(found, samples)).max() < 1.0 * MS
    assert np.diff(found).min() > 0.75 * PERIOD


def test_the_stamps_of_an_imu_with_another_rate_are_not_changed():
    samples = (5 * MS * np.arange(1, 400)).tolist()  # 200 Hz
    found, _ = ticks_of(samples)
    assert found[150:] == samples[150:]


def test_after_a_long_pause_ticks_begin_anew():
    found, _ = ticks_of([PERIOD, 2 * PERIOD, 2 * PERIOD + 501 * MS])
    assert found[-1] == 2 * PERIOD + 501 * MS


def test_an_older_sample_starts_no_tick_and_is_not_a_repeated_one():
    ticks = TickStamps(PERIOD)
    next_stamp(ticks.memory, ticks.window, 10 * PERIOD)
    assert not follows(ticks.memory, 8 * PERIOD) and ticks.repeated == 0
    assert not follows(ticks.memory, 10 * PERIOD) and ticks.repeated == 1


def test_a_reference_of_a_missing_tick_is_no_lost_tick():
    fired = []
    join = SettledJoin(
        ("state", "reference"), lambda *values: fired.append(values), ahead=Ahead("reference")
    )
    join.add("reference", 1, "r1")
    join.add("reference", 2, "r2")
    join.add("state", 2, "s2")
    assert fired == [(2, "s2", "r2")] and join.dropped == 0
    join.add("state", 3, "s3")  # a tick without its reference is lost
    join.add("reference", 4, "r4")
    join.add("state", 4, "s4")
    assert join.dropped == 1


def early_join():
    """Join of state and a reference (a stamp) that is sent one tick ahead."""
    fired = []
    ahead = Ahead("reference", partial(serves, period=PERIOD), lambda value, step: value + step)
    return SettledJoin(("state", "reference"), lambda *values: fired.append(values), ahead=ahead), (
        fired
    )


@given(
    st.lists(st.sampled_from([0.8, 1.0, 1.0, 1.0, 1.2, 2.0, 3.0, LONG]), max_size=30),
    st.lists(st.booleans(), min_size=30, max_size=30),
)
def test_one_reference_per_tick_serves_every_tick_in_any_order(steps, late):
    """late: the tick's state arrives before the reference that was sent at the tick before."""
    join, fired = early_join()
    stamps = np.cumsum([10 * PERIOD, *(round(step * PERIOD) for step in steps)]).tolist()
    join.add("state", stamps[0], "s")
    join.add("reference", stamps[0], stamps[0])  # the first tick has one of its own
    for before, stamp, state_first in zip(stamps, stamps[1:], late, strict=False):
        sent = before + PERIOD
        order = [("state", stamp, "s"), ("reference", sent, sent)]
        for one in order if state_first else order[::-1]:
            join.add(*one)
    assert fired == [(stamp, "s", stamp) for stamp in stamps]
    assert join.dropped == 0


def test_after_a_long_gap_the_tick_waits_for_its_own_reference():
    join, fired = early_join()
    for stamp in (PERIOD, (LONG + 2) * PERIOD):
        join.add("reference", stamp, stamp)
        join.add("state", stamp, "s")
        join.add("reference", stamp + PERIOD, stamp + PERIOD)
    assert [stamp for stamp, *_ in fired] == [PERIOD, (LONG + 2) * PERIOD]
    join.add("state", (2 * LONG + 3) * PERIOD, "s")
    assert len(fired) == 2
