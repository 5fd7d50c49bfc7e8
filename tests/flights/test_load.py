"""What docs/tick_budget.md says of a busy machine: it costs latency and ticks, never the record.

How much latency depends on the machine: benchmarks/load.py measures it.
"""

import pytest
from loading.conditions import CONDITIONS
from loading.flight import fly as fly_under

NAMED = {one.name: one for one in CONDITIONS}


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The flight without load."""
    return fly_under(NAMED["no load"], tmp_path_factory.mktemp("alone"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slow disk", "10 x the listeners to /diagnostics", "one core"])
def test_on_a_busy_machine_the_flight_goes_on_and_nothing_of_it_is_lost(alone, tmp_path, name):
    """In real time, hence on a machine that has the time for a flight without load."""
    busy = fly_under(NAMED[name], tmp_path)
    assert alone.outcome == busy.outcome == "completed", busy.causes
    assert busy.lost_messages == alone.lost_messages == 0
    assert busy.position < 1.5 * alone.position
    assert busy.missed < 0.1 * busy.ticks
