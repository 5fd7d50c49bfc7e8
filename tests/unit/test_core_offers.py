"""When the recorder offers its core, and when it stops."""

from types import SimpleNamespace

import pytest

from uam_lab.records.recording import topic_recorder
from uam_lab.records.recording.topic_recorder import AT_ONCE, LONG, CoreOffers


@pytest.fixture
def core(monkeypatch):
    """A core that others keep for `kept` [s]; `offers`: how often it was offered."""
    core = SimpleNamespace(kept=0.0, offers=0, now=0.0)

    def offered():
        core.offers += 1
        core.now += core.kept

    monkeypatch.setattr(topic_recorder.os, "sched_yield", offered)
    monkeypatch.setattr(topic_recorder.time, "perf_counter", lambda: core.now)
    return core


def poll(offers, messages):
    offers.begin()
    for number in range(1, messages + 1):
        offers.after(number)


def test_the_core_is_offered_after_every_few_messages(core):
    core.kept = 0.9 * LONG
    poll(CoreOffers(), 10 * AT_ONCE + AT_ONCE - 1)
    assert core.offers == 10


def test_a_program_that_keeps_the_core_gets_it_once_in_a_poll(core):
    core.kept = 1.1 * LONG
    offers = CoreOffers()
    poll(offers, 10 * AT_ONCE)
    assert core.offers == 1
    core.kept = 0.0
    poll(offers, 10 * AT_ONCE)
    assert core.offers == 11
