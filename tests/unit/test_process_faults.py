"""Process faults: kill, stop and slow down processes; none stays stopped afterwards."""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from uam_control.mission import load_scenario
from uam_lab.flights.processes.processes import Processes
from uam_lab.flights.ros.process_fault_injection import ProcessFaults
from uam_sim_bridge.faults import read_schedule

SLEEPER = """
import time
def main():
    while True:
        time.sleep(0.05)
"""
# a process with the thread names of Fast DDS
NAMED = ("dds.udp.7660", "dds.ev.0", "dds.udp.7661")
NODE = f"""
import threading, time
from pathlib import Path
def work(name):
    Path("/proc/self/task", str(threading.get_native_id()), "comm").write_text(name)
    while True:
        time.sleep(0.01)
def main():
    for name in {NAMED}:
        threading.Thread(target=work, args=(name,), daemon=True).start()
    work("main")
"""
SCENARIO = load_scenario("hover")


@contextmanager
def started(folder, code, *names):
    """Start processes with these names; each runs the module text `code`."""
    (folder / "own_code.py").write_text(code)
    path = os.pathsep.join([str(folder), *sys.path])
    with Processes(folder, {**os.environ, "PYTHONPATH": path}) as running:
        for name in names:
            running.start(name, "own_code")
        yield running


@pytest.fixture
def children(tmp_path):
    with started(tmp_path, SLEEPER, "arm_controller", "mission") as running:
        yield running


@pytest.fixture
def node(tmp_path):
    """Start the process `mission` with its threads."""
    with started(tmp_path, NODE, "mission") as running:
        until(lambda: {*NAMED, "main"} <= dict(threads(running, "mission")).keys())
        yield running


def stat(folder):
    """Return name and state from /proc: T stopped, t traced and stopped, S or R running."""
    text = (folder / "stat").read_text()
    return text.split("(", 1)[1].rsplit(")", 1)[0], text.rsplit(")", 1)[1].split()[0]


def state(children, name):
    return stat(Path(f"/proc/{children.pid(name)}"))[1]


def threads(children, name):
    """Return name and state of each thread of a process."""
    return [stat(one) for one in Path(f"/proc/{children.pid(name)}/task").iterdir()]


def until(condition, seconds=20.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "did not happen in time"
        time.sleep(0.005)


def faults(children, *texts):
    changes, clock = [], [0.0]
    schedule = read_schedule(texts, SCENARIO, 1)
    made = ProcessFaults(
        children, schedule, lambda one: changes.append((one.number, one.active)), lambda: clock[0]
    )
    return made, changes, clock


def test_a_kill_is_no_failure_of_the_flight(children):
    with faults(children, "node_kill@3")[0] as made:
        made.update(None, "transit")
        made.update(2.9, "transit")
        assert children.running("arm_controller")
        made.update(3.1, "transit")
        until(lambda: not children.running("arm_controller"))
        children.check()
        (missed,) = children.missed()
        assert missed.status == -signal.SIGKILL
        made.update(4.0, "transit")
        assert children.running("mission")


def test_a_fault_of_a_node_is_one_of_its_process(tmp_path):
    """In the fused layout; the process is not started again."""
    with started(tmp_path, SLEEPER, "scene") as running:
        running.start("flight_controller", "own_code", nodes=("mission", "arm_controller"))
        assert running.process_of("arm_controller") == "flight_controller"
        assert running.process_of("scene") == "scene"
        with faults(running, "node_kill@3")[0] as made:
            made.update(3.1, "transit")
            until(lambda: not running.running("flight_controller"))
            running.check()
            (missed,) = running.missed()
            assert missed.name == "flight_controller" and not running.revive()
            assert running.running("scene")


def test_a_stopped_process_continues_after_the_fault(children):
    made, changes, clock = faults(children, "node_stall@3+2:node=mission")
    with made:
        made.update(3.0, "transit")
        until(lambda: state(children, "mission") == "T")
        assert state(children, "arm_controller") != "T"
        clock[0] = 1.9
        made.update(3.0, "transit")  # in lockstep the mission time does not advance meanwhile
        assert changes == [(0, True)]
        clock[0] = 2.1
        made.update(3.0, "transit")
        until(lambda: state(children, "mission") != "T")
        assert changes == [(0, True), (0, False)]


def test_no_process_remains_stopped_at_the_end(children):
    with faults(children, "node_stall@0:node=mission", "node_slow@0:stopped=0.9")[0] as made:
        made.update(0.0, "transit")
        until(lambda: state(children, "mission") == "T")
    until(lambda: "T" not in (state(children, "mission"), state(children, "arm_controller")))
    time.sleep(0.05)
    assert state(children, "arm_controller") != "T"


def test_a_slow_process_is_stopped_for_a_fraction_of_the_time(children):
    with faults(children, "node_slow@0:stopped=0.8,cycle=0.05")[0] as made:
        made.update(0.0, "transit")
        seen = []
        for _ in range(200):
            seen.append(state(children, "arm_controller") == "T")
            time.sleep(0.003)
    assert 0.5 < sum(seen) / len(seen) < 0.97


def test_only_discovery_threads_are_stopped_and_they_continue(node):
    with faults(node, "discovery_loss@1:node=mission")[0] as made:
        made.update(1.0, "transit")
        states = dict(threads(node, "mission"))
        assert states["dds.udp.7660"] == states["dds.ev.0"] == "t"
        assert states["dds.udp.7661"] != "t" and states["main"] != "t"
    assert all(state != "t" for _, state in threads(node, "mission"))


def test_a_killed_process_with_stopped_threads_ends(node):
    with faults(node, "discovery_loss@1:node=mission")[0] as made:
        made.update(1.0, "transit")
        os.kill(node.pid("mission"), signal.SIGKILL)
        until(lambda: made.update(1.1, "transit") or not node.running("mission"))


def test_a_fault_on_an_ended_process_is_no_error(children):
    os.kill(children.pid("mission"), signal.SIGKILL)
    until(lambda: not children.running("mission"))
    made, changes, _ = faults(children, "node_stall@0+1:node=mission")
    with made:
        made.update(0.0, "transit")
    assert changes == [(0, True)]
