"""Processes of a flight are killed, stopped and slowed down, and none stays stopped."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import pytest

from uam_control.mission import load_scenario
from uam_sim_bridge.faults import read_schedule
from uam_sim_bridge.flight.process_faults import ProcessFaults
from uam_sim_bridge.flight.processes import Processes

SLEEPER = """
import time
def main():
    while True:
        time.sleep(0.05)
"""
SCENARIO = load_scenario("hover")


@pytest.fixture
def children(tmp_path):
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    path = os.pathsep.join([str(tmp_path), *sys.path])
    with Processes(tmp_path, {**os.environ, "PYTHONPATH": path}) as running:
        running.start("arm_controller", "sleeper")
        running.start("mission", "sleeper")
        yield running


def state(children, name):
    """As /proc has it: T stopped, S or R running."""
    stat = Path(f"/proc/{children.pid(name)}/stat").read_text()
    return stat.rsplit(")", 1)[1].split()[0]


def until(condition, seconds=5.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "did not happen in time"
        time.sleep(0.005)


def faults(children, *texts):
    told, clock = [], [0.0]
    schedule = read_schedule(texts, SCENARIO, 1)
    made = ProcessFaults(
        children, schedule, lambda one: told.append((one.number, one.active)), lambda: clock[0]
    )
    return made, told, clock


def test_a_kill_is_no_failure_of_the_flight(children):
    with faults(children, "node_kill@3")[0] as made:
        made.update(None)
        made.update(2.9)
        assert children.running("arm_controller")
        made.update(3.1)
        until(lambda: not children.running("arm_controller"))
        children.check()
        (missed,) = children.missed()
        assert missed.status == -signal.SIGKILL
        made.update(4.0)
        assert children.running("mission")


def test_who_is_stopped_goes_on_when_it_is_over(children):
    made, told, clock = faults(children, "node_stall@3+2:node=mission")
    with made:
        made.update(3.0)
        until(lambda: state(children, "mission") == "T")
        assert state(children, "arm_controller") != "T"
        clock[0] = 1.9
        made.update(3.0)  # in lockstep the mission's time stands still meanwhile
        assert told == [(0, True)]
        clock[0] = 2.1
        made.update(3.0)
        until(lambda: state(children, "mission") != "T")
        assert told == [(0, True), (0, False)]


def test_nobody_stays_stopped_at_the_end(children):
    with faults(children, "node_stall@0:node=mission", "node_slow@0:stopped=0.9")[0] as made:
        made.update(0.0)
        until(lambda: state(children, "mission") == "T")
    until(lambda: "T" not in (state(children, "mission"), state(children, "arm_controller")))
    time.sleep(0.05)
    assert state(children, "arm_controller") != "T"


def test_who_is_slow_is_stopped_for_its_part_of_the_time(children):
    with faults(children, "node_slow@0:stopped=0.8,cycle=0.05")[0] as made:
        made.update(0.0)
        seen = []
        for _ in range(200):
            seen.append(state(children, "arm_controller") == "T")
            time.sleep(0.003)
    assert 0.5 < sum(seen) / len(seen) < 0.97


def test_who_has_ended_already_is_left_alone(children):
    os.kill(children.pid("mission"), signal.SIGKILL)
    until(lambda: not children.running("mission"))
    made, told, _ = faults(children, "node_stall@0+1:node=mission")
    with made:
        made.update(0.0)
    assert told == [(0, True)]
