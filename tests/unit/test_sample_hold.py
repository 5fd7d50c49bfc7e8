"""Sample and hold against hand-worked ticks."""

from __future__ import annotations

from uam_control.control.sample_hold import is_new, new_hold

PERIOD = 0.004


def ticks_with_a_new_command(rate, count, first=0):
    hold = new_hold(rate)
    return [i for i in range(first, first + count) if is_new(hold, i * PERIOD)]


def test_without_a_rate_every_tick_is_new():
    assert ticks_with_a_new_command(0.0, 5) == [0, 1, 2, 3, 4]


def test_a_rate_that_divides_the_ticks_gives_every_nth():
    assert ticks_with_a_new_command(50.0, 20) == [0, 5, 10, 15]


def test_another_rate_is_kept_on_average():
    # 30 Hz: the periods begin at 0, 33.3, 66.7, 100 ms; the first ticks in them are 0, 36, 68, 100
    assert ticks_with_a_new_command(30.0, 26) == [0, 9, 17, 25]
    assert len(ticks_with_a_new_command(30.0, 250)) == 30


def test_the_first_tick_is_new_wherever_it_is():
    assert ticks_with_a_new_command(50.0, 10, first=3) == [3, 5, 10]


def test_a_clock_that_begins_anew_gives_a_new_command():
    hold = new_hold(10.0)
    assert is_new(hold, 5.0) and not is_new(hold, 5.05)
    assert is_new(hold, 0.0)


def test_a_rate_below_one_hertz():
    hold = new_hold(0.5)
    assert [is_new(hold, time) for time in (0.0, 1.0, 1.996, 2.0, 3.9, 4.0)] == [
        True, False, False, True, False, True,
    ]  # fmt: skip
