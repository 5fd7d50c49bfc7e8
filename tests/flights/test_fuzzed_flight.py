"""A flight among malformed, extreme and deep messages on every topic that its nodes read."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import whole_flight
from longer import longer
from whole_flight import SHORT

from uam_lab.flights.processes.node_environment import transport_environment
from uam_lab.records.results import timeseries
from uam_msgs_py.messages import topics

FUZZ = Path(__file__).parents[1] / "fuzz_topics.py"
# read by nodes of every flight with a cockpit; the graph has more
READ = (topics.GOAL_POSE, topics.STATE, topics.CHANGES, topics.DIAGNOSTICS, topics.TF)
LONG = SHORT.replace("from: 2,", "from: 600, name: 600 s}\n  - {from: 7200,").replace(
    "at: 2,", "at: 7200,"
)


def fuzzed(fly, folder, *options, until="hover"):
    """Fly in a namespace, with a cockpit, and fuzz until each topic is covered, then land.

    The flight hovers until then, and until the phase `until`, so no speed of the machine matters.
    Return the flight.
    """
    scenario = folder / "hover.yaml"
    scenario.write_text(LONG)
    flight = fly("--scenario", str(scenario), "--namespace", "uav1", "--view", *options)
    flight.until_phase("hover")
    nodes = flight.children()
    domain = flight.said.split("in ROS domain ")[1].split(",")[0]
    surroundings = {**os.environ, **transport_environment(), "ROS_DOMAIN_ID": domain}
    fuzz = subprocess.Popen(
        [sys.executable, FUZZ, "--seconds", str(whole_flight.PATIENCE), "--each", "8"],
        env=surroundings,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        assert fuzz.stdout.readline() == "covered\n"
        flight.until_phase(until)
        alive = flight.children()
        land = [sys.executable, "-m", "uam_lab.cli.main", "land", "--instance"]
        subprocess.run([*land, str(flight.instance)], check=True)
    finally:
        fuzz.send_signal(signal.SIGINT)
        sent = json.loads(fuzz.communicate()[0] or "{}")
    assert alive == nodes, "no node has ended, none was started again"
    flight.wait()
    for topic in READ:
        name = topic.name if topic.name.startswith("/") else f"/uav1/{topic.name}"
        assert sent.get(name), f"{name}: not fuzzed"
    assert "Traceback" not in flight.complained
    return flight


def complete(flight):
    """Check that all results are there, with a row for each tick."""
    metrics = json.loads((flight.out / "metrics.json").read_text())
    assert metrics["shortfalls"] == ["aborted: land by command"], flight.said + flight.complained
    assert metrics["transitions"][-1]["cause"] == "touchdown"
    time_of = timeseries.read(flight.out / "timeseries.parquet").time
    assert {round(1e6 * step) for step in time_of[1:] - time_of[:-1]} == {4000}
    lost = json.loads((flight.out / "logs/recorder.json").read_text())["lost"]
    assert not {name for name in lost if "/uam/state" in name or "/imu/" in name}


@pytest.mark.parametrize(
    "options",
    [
        longer((), id="separate"),
        pytest.param(("--fused",), id="fused", marks=pytest.mark.slow),  # for the time of CI
    ],
)
def test_a_fuzzed_flight_ends_complete_with_every_node_alive(fly, tmp_path, options):
    complete(fuzzed(fly, tmp_path, *options))


@pytest.mark.slow
def test_ten_minutes_of_fuzz(fly, tmp_path, monkeypatch):
    monkeypatch.setattr(whole_flight, "PATIENCE", 3600.0)
    complete(fuzzed(fly, tmp_path, until="600 s"))
