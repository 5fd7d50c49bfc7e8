"""A flight as seen and changed with ROS's own command line, where that is installed."""

import json
import os
import re
import shutil
import signal
import subprocess

import numpy as np
import pytest
import yaml

from uam_control.profiles.profile import CONTROLLERS, NODES, load_profile
from uam_msgs_py.node.wiring import BRIDGE, PLANT, RECORDER, SCENE

# topic → rate [Hz of simulated time], as docs/architecture.md and messages/topics.py promise
RATES = {
    "/imu/data": 250.0,
    "/uam/state": 250.0,
    "/uam/arm/command": 250.0,
    "/vrpn_mocap/uam/pose": 120.0,
    "/uam/position/adaptation": 50.0,
    "/uam/tracking/error": 25.0,
}
SECONDS = 6  # to measure a rate in; `ros2 topic hz` says one in each
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("ros2") is None, reason="needs ROS's command line, ros2"),
]


@pytest.fixture
def flight(fly):
    """A mission under way."""
    flight = fly()
    flight.until_phase("approach")
    return flight


@pytest.fixture
def ros2(flight, monkeypatch):
    """ros2(*words) runs it in the flight's ROS domain; returns what it said."""
    domain = flight.said.split("ROS domain ")[1].split(",")[0]
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

    def run(*words: str, until: str = "", count: int = 1) -> str:
        """until: a word that it says for ever, after which it is interrupted, the count-th time."""
        command = subprocess.Popen(
            ["ros2", *words],
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        lines = []
        for line in command.stdout if until else ():
            lines.append(line)
            if sum(until in said for said in lines) == count:
                command.send_signal(signal.SIGINT)
                break
        return "".join(lines) + command.communicate(timeout=60.0)[0]

    run("daemon", "start")  # first, so that every command asks the same one
    yield run
    run("daemon", "stop")


def test_nodes_parameters_and_services(flight, ros2, tmp_path):
    expected = {f"/{name}" for name in (*NODES, BRIDGE, PLANT, RECORDER, SCENE)}
    flight.until(lambda: expected <= set(ros2("node", "list").split()), "all nodes to be listed")

    for node in CONTROLLERS:
        known = load_profile("s500").section(node)
        assert set(known) <= set(ros2("param", "list", f"/{node}").split())
        reported = ros2("param", "describe", f"/{node}", "lambda_1")
        assert "gain on e" in reported and "1/s^2" in reported, reported
        said = ros2("param", "set", f"/{node}", "varpi", "0.3")
        assert "successful" in said, said
        said = ros2("param", "set", f"/{node}", "varpi", "-1.0")
        assert "failed" in said and "varpi: -1.0 is outside" in said, said

        file = tmp_path / f"{node}.yaml"
        file.write_text(ros2("param", "dump", f"/{node}"))
        dumped = yaml.safe_load(file.read_text())[f"/{node}"]["ros__parameters"]
        assert dumped["varpi"] == 0.3
        assert dumped["lambda_1"] == known["lambda_1"]
        said = ros2("param", "load", f"/{node}", str(file))
        assert re.search(r"varpi.*successful", said), said

    said = ros2("service", "call", "/arm_controller/reset_adaptation", "std_srvs/srv/Trigger")
    assert "success=True" in said, said

    flight.process.send_signal(signal.SIGINT)
    assert flight.wait() == 130  # as every program that Ctrl-C has ended
    changes = json.loads((flight.out / "info.json").read_text())["parameter_changes"]
    for node in CONTROLLERS:
        values = [
            c["values"]["varpi"][1]
            for c in changes
            if c["node"] == node and "varpi" in c["values"] and c["accepted"]
        ]
        refused = [c for c in changes if c["node"] == node and not c["accepted"]]
        assert values[0] == 0.3
        assert any("varpi: -1.0 is outside" in c["reason"] for c in refused)
    assert any(c["by"] == "reset_adaptation" for c in changes)


def test_topics_have_the_promised_rates(flight, ros2):
    """As `ros2 topic hz` sees them; on a busy machine it stands still at times and misses some."""
    for topic, promised in RATES.items():
        words = ("topic", "hz", "--use-sim-time", "--window", "100000", topic)
        said = ros2(*words, until="average rate", count=SECONDS)
        rates = np.array(re.findall(r"average rate: ([\d.]+)", said), float)
        counts = np.array(re.findall(r"window: (\d+)", said), float)
        rates = rates[: len(counts)]
        between = np.diff(counts) / np.diff(counts / rates)  # from one report to the next
        assert np.max(between) == pytest.approx(promised, rel=0.05), (topic, said)
