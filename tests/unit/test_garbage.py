"""Garbage is collected between two ticks and not in them."""

import gc
import weakref

import pytest

from uam_msgs_py.node.process_options import GarbageCollection


class Knot:
    """An object that only the collector removes."""

    def __init__(self):
        self.itself = self


@pytest.fixture(autouse=True)
def python_collects_again():
    yield
    gc.enable()
    gc.unfreeze()


def knots() -> weakref.ref:
    """Make more knots than the threshold of the youngest generation; return the first."""
    first = weakref.ref(Knot())
    for _ in range(gc.get_threshold()[0] + 100):
        Knot()
    return first


def test_knots_stay_until_the_node_is_at_rest():
    with GarbageCollection() as garbage:
        knot = knots()
        assert knot() is not None
        garbage.at_rest()
        assert knot() is None
    assert gc.isenabled()


def test_few_objects_are_not_worth_a_collection():
    with GarbageCollection() as garbage:
        one = weakref.ref(Knot())
        garbage.at_rest()
        assert one() is not None


def test_memory_stays_bounded():
    with GarbageCollection() as garbage:
        garbage.at_rest()
        before = len(gc.get_objects())
        for _ in range(300):  # every generation becomes due
            knots()
            garbage.at_rest()
        assert len(gc.get_objects()) < before + 3 * gc.get_threshold()[0]


def test_python_may_go_on_collecting():
    with GarbageCollection(between_ticks=False) as garbage:
        assert gc.isenabled()
        knot = knots()
        assert knot() is None  # within its own allocations
        garbage.at_rest()
