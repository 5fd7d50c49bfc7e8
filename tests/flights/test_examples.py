"""The examples do what their texts say."""

import json
import os
import signal
import subprocess
import sys

import pytest
from longer import longer
from whole_flight import PATIENCE, ROOT

from uam_lab import Flight

EXAMPLES = ROOT / "examples"


@pytest.fixture
def beside(tmp_path):
    """beside(example, flight) starts an example beside a flight; it ends with the test."""
    running = []

    def start(example: str, flight) -> subprocess.Popen:
        flight.until(lambda: "ROS_DOMAIN_ID=" in flight.said, "the domain to be named")
        domain = flight.said.split("ROS_DOMAIN_ID=")[1].split()[0]
        surroundings = os.environ | {"ROS_DOMAIN_ID": domain, "ROS_LOG_DIR": str(tmp_path)}
        program = [sys.executable, EXAMPLES / example]
        running.append(subprocess.Popen(program, env=surroundings))
        return running[-1]

    yield start
    for process in running:  # not killed: nodes of the next flight in this domain would see it
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)


@pytest.mark.long
def test_a_controller_and_a_mission_of_ones_own_fly_and_the_log_is_read(fly, beside):
    flight = fly("--scenario", "hover", "--without", "arm_controller", "--without", "mission")
    beside("own_controller.py", flight)
    beside("own_mission.py", flight)
    assert flight.wait() == 0, flight.said + flight.complained
    started = {file.stem for file in (flight.out / "logs").glob("*.log")}
    assert not started & {"arm_controller", "mission"} and "position_controller" in started
    found = json.loads((flight.out / "metrics.json").read_text())
    assert found["mission_completed"] and found["abort_reason"] in (None, "")
    assert 8.0 < found["duration_s"] < 9.0 and found["rms"]["position_m"][2] < 0.1

    pytest.importorskip("pandas")
    rms = {
        words[0]: float(words[1])
        for words in map(str.split, run("read_log.py", flight.out / "log.mcap").splitlines()[2:])
    }
    assert set(rms) == {"x", "y", "z", "yaw", "alpha_1", "alpha_2"}
    assert rms["z"] < 0.1 and rms["alpha_1"] < 5.0 and rms["alpha_2"] < 5.0, rms


def test_the_scenario_of_ones_own_is_flown(tmp_path):
    with Flight(scenario=EXAMPLES / "own_scenario.yaml", engine="direct", out=tmp_path) as flight:
        found = flight.wait().metrics
    assert found["mission_completed"] and found["scenario"] == "own_scenario"


def run(example: str, *arguments: object) -> str:
    """Run an example; return its output."""
    command = [sys.executable, EXAMPLES / example, *map(str, arguments)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_an_estimator_of_ones_own_flies(tmp_path):
    """It hovers as the usual one does, within 0.03 m, with errors of its own."""
    x, y, z = map(float, run("own_estimator.py", tmp_path / "flown").split()[2:])
    assert 0.001 < max(x, y, z) < 0.03


def test_a_gripper_of_ones_own_lifts_the_payload(tmp_path):
    _, lifted, *_, place_error = run("own_gripper.py", tmp_path / "flown").split()
    assert lifted == "True" and float(place_error) < 0.1


def test_a_firmware_of_ones_own_is_spoken(tmp_path):
    assert run("own_firmware.py", tmp_path / "flown").split()[-1] == "True"


@pytest.mark.long
def test_a_gain_is_swept(tmp_path):
    rows = run("sweep_gain.py", tmp_path).splitlines()[1:]
    assert len(rows) == 3 and all(row.endswith("True") for row in rows)
    figures = [json.loads(file.read_text()) for file in tmp_path.glob("*/metrics.json")]
    errors = {tuple(one["rms"]["position_m"]) for one in figures}
    assert len(errors) == 3, "each gain has errors of its own"


@pytest.mark.long
def test_two_vehicles_fly_at_once(tmp_path, short_scenario):
    said = run("two_vehicles.py", tmp_path, short_scenario)
    assert "follower: arming" in said
    assert "leader True" in said and "follower True" in said
    one, other = said.split("domains ")[1].splitlines()[0].split()
    assert one != other


@pytest.mark.parametrize("engine", ["direct", longer("ros")])
def test_the_simulator_of_ones_own_flies(engine, tmp_path, short_scenario):
    said = run("own_simulator.py", engine, short_scenario, tmp_path)
    found = json.loads((tmp_path / "metrics.json").read_text())
    assert found["mission_completed"] and str(found["rms"]) in said
    assert max(found["max"]["arm_deg"]) == 0.0, "its arm stands still"


@pytest.mark.long
def test_a_tour_of_goals_is_flown(tmp_path):
    said = run("goto_tour.py", tmp_path)
    assert said.count("accepted") == 5 and said.count("there at") == 4
    assert "too low: refused: out of reach: the hand's z is -0.10 m" in said
    assert float(said.split("  hand: ")[1].split()[0]) < 20.0, "[mm]"
    assert "too far: refused: x is 99.00 m" in said and "landed: touchdown" in said
    off = [float(line.split(", ")[1].split()[0]) for line in said.splitlines() if "there" in line]
    assert max(off) < 20.0, "[mm]"


@pytest.mark.long
def test_the_planner_of_ones_own_flies_a_circle(tmp_path):
    said = run("own_planner.py", tmp_path)
    west, east = (float(word) for word in said.split("circle: ")[1].split()[:3:2])
    assert abs(west + 0.4) < 0.03 and abs(east - 0.4) < 0.03
