"""A wait in lockstep ends by what the nodes have done, not by the wall clock."""

from collections import Counter

import pytest

from uam_sim_bridge.nodes import lockstep
from uam_sim_bridge.nodes.lockstep import REPORTS, SAY_AFTER, Awaited

NODES = ("mission", "arm_controller")


class Reported:
    """The reports of the nodes so far."""

    def __init__(self):
        self.counts = Counter()

    def reports(self, node):
        return self.counts[node]


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(lockstep.time, "monotonic", lambda: now[0])
    return now


def test_it_is_lost_when_every_node_has_reported_often_enough(clock):
    reported, told = Reported(), []
    wait = Awaited(reported, NODES, told.append)
    reported.counts.update(dict.fromkeys(NODES, 1000))
    wait.told(lambda: "setpoint")
    assert told == [] and not wait.lost
    clock[0] += SAY_AFTER + 0.1
    wait.told(lambda: "setpoint")
    assert told == ["setpoint"] and not wait.lost
    clock[0] += 1e6  # no wall time ends it
    reported.counts["mission"] += 1000
    wait.told(lambda: "setpoint")
    assert not wait.lost, "arm_controller may be slow"
    reported.counts["arm_controller"] += REPORTS - 1
    assert not wait.lost
    reported.counts["arm_controller"] += 1
    assert wait.lost
    wait.begin()
    assert not wait.lost


def test_without_nodes_that_report_it_never_ends(clock):
    wait = Awaited(Reported(), (), lambda whom: None)
    clock[0] += 10.0
    wait.told(lambda: "setpoint")
    assert not wait.lost
