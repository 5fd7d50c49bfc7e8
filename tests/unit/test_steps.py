"""A value that changes at certain times is that of a search at every time."""

from hypothesis import given
from hypothesis import strategies as st

from uam_control.mission.steps import Steps

TIMES = st.integers(-5, 20).map(float)


@given(st.lists(TIMES, max_size=6), st.lists(TIMES, max_size=40))
def test_the_value_is_that_of_the_function_forwards_and_backwards(changes, times):
    def value(time):
        return sum(at <= time for at in changes)

    steps = Steps(value, changes)
    assert [steps.at(time) for time in times] == [value(time) for time in times]


def test_between_two_changes_nothing_is_searched():
    asked = []
    steps = Steps(asked.append, [3.0, 1.0])
    for time in (0.5, 0.9, 1.0, 2.9, 1.5, 3.0, 9.0, 0.0):
        steps.at(time)
    assert asked == [0.5, 1.0, 3.0, 0.0]
