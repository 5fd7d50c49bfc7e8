"""Patience: time limits that do not count pauses of the machine."""

import math

import pytest

from uam_sim_bridge import paced_clock
from uam_sim_bridge.paced_clock import Patience


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets: clock[0] [s]."""
    now = [100.0]
    monkeypatch.setattr(paced_clock.time, "monotonic", lambda: now[0])
    return now


def test_it_is_over_after_its_seconds(clock):
    waiting = Patience(1.0)
    for _ in range(9):
        clock[0] += 0.1
        assert not waiting.over
    clock[0] += 0.11
    assert waiting.over
    assert waiting.left == 0.0


def test_a_pause_of_the_machine_counts_one_slice(clock):
    waiting = Patience(10.0)
    clock[0] += 3600.0
    assert waiting.left == pytest.approx(9.5)


def test_it_may_be_endless(clock):
    waiting = Patience(math.inf)
    clock[0] += 1e9
    assert not waiting.over
