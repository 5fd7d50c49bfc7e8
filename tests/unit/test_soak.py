"""benchmarks/soak.py: growth is distinguished from fluctuation."""

import os

import pytest
from soaking import judgement
from soaking.samples import Soak, Usage, usage


def verdict(memory, handles=lambda k: 6, threads=lambda k: 4, count=40):
    soak = Soak("a soak", "wall time")
    for k in range(count):
        soak.add("node", 10.0 * k, Usage(memory(k), handles(k), threads(k)))
    return judgement.judge(soak)


@pytest.mark.parametrize(
    ("uses", "grown"),
    [
        ({"memory": lambda k: 100.0 + 10.0 * (k % 7 == 0)}, False),  # comes and goes
        ({"memory": lambda k: 100.0 + 2.5 * (k > 5)}, False),  # caches that fill
        ({"memory": lambda k: 100.0 + 0.5 * k}, True),
        ({"memory": lambda k: 10.0 + 0.2 * k}, True),  # small, but for ever
        ({"memory": lambda k: 100.0, "handles": lambda k: 6 + k // 30}, True),
        ({"memory": lambda k: 100.0, "threads": lambda k: 4 + k // 35}, True),
        ({"memory": lambda k: 100.0, "handles": lambda k: 6 + (k == 3)}, False),
    ],
)
def test_what_goes_on_growing_is_found(uses, grown):
    (found,) = verdict(**uses)
    assert found.grown == grown
    assert ("grown" if grown else "flat") in judgement.table([found])


def test_who_was_seen_too_short_is_not_judged():
    assert verdict(lambda k: 100.0 * k, count=7) == []


def test_this_process_uses_memory_handles_and_a_thread():
    assert usage(1 << 30) is None  # no such process
    with open(__file__) as held:
        used = usage(os.getpid())
        assert held and used.memory > 1.0 and used.threads >= 1
    assert usage(os.getpid()).handles == used.handles - 1
