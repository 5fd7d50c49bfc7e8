"""Settings of all tests."""

import gc
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# The first call of a compiled function takes seconds; a run must not depend on chance.
settings.register_profile("uam", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("uam")

# helper modules that several test folders import, and what the benchmarks are made of
TESTS = Path(__file__).parent
sys.path[:0] = [str(TESTS), str(TESTS.parent / "benchmarks")]

# A shell starts a job in the background with SIGINT ignored, and so would be every process that the
# tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Spare what is loaded here the garbage collection, which is a tenth of the tests' time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(10_000, 20, 100)  # flights make few cycles: ten times more seldom
        gc.enable()


# The tests that take longest begin first: workers then end at the same time. In unit/ they are
# behind the middle of the alphabet, so each folder begins with its end.
ORDER = ("px4", "packaging", "nodes", "flights", "unit")


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items):
    """Give the tests of a file one worker (--dist loadgroup); flights are apart, or as they say."""
    folders = {item: item.path.relative_to(TESTS).parts[0] for item in items}
    for item, folder in folders.items():
        if "direct_flight" in item.fixturenames:  # flown once, takes longer than its tests
            item.add_marker(pytest.mark.xdist_group("direct flight"))
        elif folder != "flights":
            item.add_marker(pytest.mark.xdist_group(str(item.path)))
    items.sort(key=lambda item: str(item.path), reverse=True)
    items.sort(key=lambda item: ORDER.index(folders[item]))
