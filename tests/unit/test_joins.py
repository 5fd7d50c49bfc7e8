"""Joins of messages by stamp."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from settled_join import SettledJoin

from uam_msgs_py.node.joins import StampJoin


def joined(depth=32, kind=SettledJoin):
    fired = []
    join = kind(["a", "b", "c"], lambda stamp, *values: fired.append((stamp, values)), depth)
    return join, fired


def test_it_fires_when_the_last_input_of_a_stamp_arrives():
    join, fired = joined()
    join.add("c", 4, "c4")
    join.add("a", 4, "a4")
    assert fired == []
    join.add("b", 4, "b4")
    assert fired == [(4, ("a4", "b4", "c4"))]


def test_skipped_stamps_do_not_fire():
    join, fired = joined()
    join.add("a", 4, 1)
    join.skip(8)
    for stamp in (4, 8, 12):
        for name in "abc":
            join.add(name, stamp, stamp)
    assert [stamp for stamp, _ in fired] == [12]


def test_arrays_are_values_like_any_other():
    join, fired = joined()
    for name in "abc":
        join.add(name, 4, np.zeros(3))
    assert len(fired) == 1


@given(st.permutations([(name, stamp) for stamp in (4, 8, 12) for name in "abc"]))
def test_every_order_of_arrival_fires_in_order_and_never_mixes(order):
    join, fired = joined()
    for name, stamp in order:
        join.add(name, stamp, (name, stamp))
    stamps = [stamp for stamp, _ in fired]
    assert stamps == sorted(set(stamps)) and stamps[-1] == 12
    for stamp, values in fired:
        assert values == tuple((name, stamp) for name in "abc")


def test_an_incomplete_tick_is_dropped_and_counted():
    join, fired = joined()
    join.add("a", 4, 1)
    for name in "abc":
        join.add(name, 8, 1)
    join.add("b", 4, 1)  # too late
    assert [stamp for stamp, _ in fired] == [8]
    assert join.dropped == 2


def test_memory_is_bounded():
    join, fired = joined(depth=4)
    for stamp in range(100):
        join.add("a", stamp, 1)
    assert join.dropped == 96
    for name in "bc":
        join.add(name, 99, 1)
    assert [stamp for stamp, _ in fired] == [99]


@given(st.integers(0, 9))
def test_a_long_backlog_keeps_only_the_newest_tick(ticks):
    join, fired = joined(kind=StampJoin)
    for stamp in range(ticks):
        for name in "abc":
            join.add(name, stamp, stamp)
    assert fired == []
    join.settle()
    every = list(range(ticks))
    assert [stamp for stamp, _ in fired] == (every if ticks <= 3 else every[-1:])
    assert len(fired) + join.dropped == ticks
    join.settle()
    assert len(fired) + join.dropped == ticks
