"""A flight among malformed, extreme and deep messages on every topic that its nodes read."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import whole_flight
from whole_flight import SHORT

from uam_lab.processes.node_environment import transport_environment
from uam_lab.results import timeseries
from uam_msgs_py.messages import topics

FUZZ = Path(__file__).parents[1] / "fuzz_topics.py"
# read by nodes of every flight with a cockpit; the graph has more
READ = (topics.GOAL_POSE, topics.STATE, topics.CHANGES, topics.DIAGNOSTICS, topics.TF)


def fuzzed(fly, scenario, *options):
    """Fly in a namespace, with a cockpit, and fuzz until the landing; return the flight."""
    flight = fly("--scenario", str(scenario), "--namespace", "uav1", "--view", *options)
    flight.until_phase("take-off")
    nodes = flight.children()
    domain = flight.said.split("in ROS domain ")[1].split(",")[0]
    surroundings = {**os.environ, **transport_environment(), "ROS_DOMAIN_ID": domain}
    fuzz = subprocess.Popen(
        [sys.executable, FUZZ, "--seconds", "3600"],
        env=surroundings,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        flight.until_phase("land")
        alive = flight.children()
    finally:
        fuzz.send_signal(signal.SIGINT)
        sent = json.loads(fuzz.communicate()[0] or "{}")
    assert alive == nodes, "no node has ended, none was started again"
    assert flight.wait() == 0, flight.said + flight.complained
    for topic in READ:
        name = topic.name if topic.name.startswith("/") else f"/uav1/{topic.name}"
        assert sent.get(name), f"{name}: not fuzzed"
    assert "Traceback" not in flight.complained
    return flight


def complete(flight):
    """Check that all results are there, with a row for each tick."""
    metrics = json.loads((flight.out / "metrics.json").read_text())
    assert metrics["mission_completed"] and not metrics["shortfalls"]
    time_of = timeseries.read(flight.out / "timeseries.parquet").time
    assert {round(1e6 * step) for step in time_of[1:] - time_of[:-1]} == {4000}
    lost = json.loads((flight.out / "logs/recorder.json").read_text())["lost"]
    assert not {name for name in lost if "/uam/state" in name or "/imu/" in name}


# slow: a fused flight of 20 s can be over before the fuzzer has started
FUSED = pytest.param(("--fused",), marks=pytest.mark.slow, id="fused")


SEPARATE = pytest.param((), marks=pytest.mark.long, id="separate")


@pytest.mark.parametrize("options", [SEPARATE, FUSED])
def test_a_fuzzed_flight_ends_complete_with_every_node_alive(fly, tmp_path, options):
    scenario = tmp_path / "hover.yaml"
    scenario.write_text(SHORT.replace("from: 2,", "from: 20,").replace("at: 2,", "at: 20,"))
    complete(fuzzed(fly, scenario, *options))


@pytest.mark.slow
def test_ten_minutes_of_fuzz(fly, tmp_path, monkeypatch):
    scenario = tmp_path / "hover.yaml"
    scenario.write_text(SHORT.replace("from: 2,", "from: 600,").replace("at: 2,", "at: 600,"))
    monkeypatch.setattr(whole_flight, "PATIENCE", 3600.0)
    complete(fuzzed(fly, scenario))
