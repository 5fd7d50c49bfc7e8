"""Compiled steps in a row: where a loop over them ends."""

from __future__ import annotations

import numpy as np
import pytest

from uam_control.maths.compiled import borrowing
from uam_control.stages.step import ASK, DECIDE, DONE, MANY, Step, Steps


@borrowing
def count(a):
    """Count the call; numbers: calls so far, the one that is not DONE, and what it says."""
    (numbers,) = a
    numbers[0] += 1
    return numbers[2] if numbers[0] == numbers[1] else DONE


def steps(*planned):
    """Return four steps and a question; planned: (place, call, outcome), by count."""
    numbers = np.zeros((5, 3), dtype=np.int64)
    for place, call, outcome in planned:
        numbers[place, 1:] = call, outcome
    made = [Step(count, (row,)) for row in numbers]
    return Steps(made[:4], made[4]), numbers[:, 0]


def test_a_loop_flies_the_ticks_that_it_is_given():
    made, calls = steps()
    loop, _ = made.loop(2)
    assert loop(3, True) == (3, 0)
    assert calls.tolist() == [3, 3, 3, 3, 3]


@pytest.mark.parametrize(
    ("place", "end", "calls"),
    [
        (0, DECIDE, [3, 2, 2, 2, 2]),
        (1, DECIDE + MANY, [3, 3, 2, 2, 2]),
        (2, -DECIDE, [3, 3, 3, 2, 2]),
        (3, -(DECIDE + MANY), [3, 3, 3, 3, 2]),
    ],
)
def test_a_loop_ends_at_the_step_that_has_something_to_decide(place, end, calls):
    made, counted = steps((place, 3, DECIDE))
    loop, _ = made.loop(2)
    assert loop(5, True) == (2, end)
    assert counted.tolist() == calls


def test_after_a_question_a_tick_goes_on_with_its_second_half():
    made, calls = steps((1, 2, ASK))
    loop, _ = made.loop(2)
    assert loop(3, True) == (1, ASK + MANY)
    assert loop(1, False) == (2, 0)
    assert calls.tolist() == [3, 3, 3, 3, 3]


def test_a_loop_pauses_where_the_last_question_says_so():
    made, _ = steps((4, 2, ASK))
    loop, _ = made.loop(2)
    assert loop(5, True) == (2, 0)


def test_a_part_without_a_step_leaves_the_others_to_be_called():
    numbers = np.zeros((2, 3), dtype=np.int64)
    step, last = (Step(count, (row,)) for row in numbers)
    split = Steps([None, step], last)
    assert not split.whole and steps()[0].whole
    assert split.calls[0] is None and split.calls[1]() == DONE
    assert numbers[:, 0].tolist() == [1, 0]
