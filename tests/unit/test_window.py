"""The window of handed-out items: each item once, few at a time, whatever is lost."""

from hypothesis import given
from hypothesis import strategies as st

from uam_lab.experiments.workers.workers import LOST_AT_MOST, PER_WORKER, Window


def test_items_are_drawn_only_when_there_is_room():
    drawn = []

    def items():
        for k in range(100):
            drawn.append(k)
            yield k

    window = Window(items())
    assert [number for number, _ in window.fill(2)] == list(range(2 * PER_WORKER))
    assert len(drawn) == 2 * PER_WORKER and window.fill(2) == []
    window.done(3)
    assert window.fill(2) == [(6, 6)]
    assert len(window.fill(3)) == PER_WORKER  # a third worker
    assert window.fill(0) == []  # all workers are gone


def test_without_a_worker_something_waits_for_the_first():
    assert len(Window("abcdefgh").fill(0)) == PER_WORKER


def test_an_item_that_loses_every_worker_is_given_up():
    window = Window("a")
    window.fill(1)
    assert all(window.lost(0) for _ in range(LOST_AT_MOST))
    assert not window.lost(0)


@given(
    total=st.integers(0, 60),
    events=st.lists(
        st.tuples(st.integers(0, 5), st.booleans(), st.integers(0, 1000)), max_size=300
    ),
)
def test_every_item_is_done_once_and_the_window_is_bounded(total, events):
    window, out, done = Window(range(total)), [], []
    room = PER_WORKER
    for workers, is_lost, which in [*events, *[(1, False, 0)] * total]:
        room = max(room, PER_WORKER * workers)  # outstanding ones stay when workers leave
        for number, item in window.fill(workers):
            assert number == item and number not in out
            out.append(number)
        assert len(window) == len(out) <= room
        if out:
            number = out.pop(which % len(out))
            if is_lost and window.lost(number):
                continue
            window.done(number)
            done.append(number)
    assert sorted(done) == list(range(total)) and not window.fill(1)
