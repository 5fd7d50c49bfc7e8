"""What docs/endurance.md says of a busy machine: latency first, ticks then, never the record."""

import importlib
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def loading():
    folder = str(Path(__file__).parents[2] / "benchmarks")
    sys.path.insert(0, folder)
    yield {name: importlib.import_module(f"loading.{name}") for name in ("conditions", "flight")}
    sys.path.remove(folder)


@pytest.fixture(scope="module")
def alone(loading, tmp_path_factory):
    """The flight without load."""
    conditions = loading["conditions"].CONDITIONS
    return loading["flight"].fly(conditions[0], tmp_path_factory.mktemp("alone"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slow disk", "10 x the listeners to /diagnostics", "one core"])
def test_a_busy_machine_costs_latency_before_anything_else(loading, alone, tmp_path, name):
    """In real time, hence on a machine that has the time for a flight without load."""
    conditions = {one.name: one for one in loading["conditions"].CONDITIONS}
    busy = loading["flight"].fly(conditions[name], tmp_path)
    assert alone.outcome == busy.outcome == "completed", busy.told
    assert busy.latency_p50 > alone.latency_p50
    assert busy.lost_messages == alone.lost_messages == 0
    assert busy.position < 1.5 * alone.position
    assert busy.missed < 0.1 * busy.ticks
