"""Compiled steps in a row: where a loop over them ends."""

from __future__ import annotations

import numpy as np
import pytest

from uam_control.maths.compiled import borrowing
from uam_control.stages.step import ASK, DECIDE, DONE, ENDED, MANY, Step, Steps


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
    return Steps(made[:4], 2, made[4]), numbers[:, 0]


def test_a_loop_flies_the_ticks_that_it_is_given():
    made, calls = steps()
    assert made(3, True) == (3, 0)
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
    assert made(5, True) == (2, end)
    assert counted.tolist() == calls


def test_after_a_question_a_tick_goes_on_with_its_second_half():
    made, calls = steps((1, 2, ASK))
    assert made(3, True) == (1, ASK + MANY)
    assert made(1, False) == (2, 0)
    assert calls.tolist() == [3, 3, 3, 3, 3]


def test_a_loop_pauses_where_the_last_question_says_so():
    made, _ = steps((4, 2, ASK))
    assert made(5, True) == (2, 0)


def test_a_part_in_python_is_called_in_its_turn():
    numbers, called = np.zeros((2, 3), dtype=np.int64), []
    step, last = (Step(count, (row,)) for row in numbers)

    def part():
        called.append(numbers[0, 0])
        return DONE if len(called) < 3 else ENDED

    made = Steps([step, part], 1, last)
    assert made(5, True) == (2, -ENDED)
    assert called == [1, 2, 3] and numbers[:, 0].tolist() == [3, 2]


def test_an_error_in_a_step_comes_out_of_the_loop():
    @borrowing
    def divide(a):
        (numbers,) = a
        return 1 // int(numbers[0])

    row = np.zeros(3, dtype=np.int64)
    made = Steps([Step(divide, (row,))], 1, Step(count, (row,)))
    with pytest.raises(ZeroDivisionError):
        made(1, True)
