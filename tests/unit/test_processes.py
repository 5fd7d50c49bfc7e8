"""Supervision of child processes, with small stand-in programs instead of nodes."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from uam_lab.flights.processes import child, process_table, processes
from uam_lab.flights.processes.processes import NodeFailed, Processes

SLEEPER = """
import signal, sys, time
def main():
    signal.signal(signal.SIGINT, lambda *_: sys.exit(0))
    print("options", *sys.argv[1:])
    print("ready", flush=True)
    while True:
        time.sleep(0.05)
"""
STUBBORN = """
import signal, time
def main():
    for s in (signal.SIGINT, signal.SIGTERM):
        signal.signal(s, signal.SIG_IGN)
    print("ready", flush=True)
    while True:
        time.sleep(0.05)
"""
FAILING = """
def main():
    print("one line before")
    raise RuntimeError("no thrust curve")
"""


@pytest.fixture
def children(tmp_path):
    for name, text in (("sleeper", SLEEPER), ("stubborn", STUBBORN), ("failing", FAILING)):
        (tmp_path / f"{name}.py").write_text(text)
    path = os.pathsep.join([str(tmp_path), *sys.path])
    with Processes(tmp_path, {**os.environ, "PYTHONPATH": path}) as running:
        yield running


def wait_for(condition, seconds=20.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "did not happen in time"
        time.sleep(0.01)


def ready(children, name):
    wait_for(lambda: "ready" in processes.tail(children._logs / f"{name}.log"))


def gone(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def test_a_child_obeys_the_interrupt(children):
    children.start("a", "sleeper")
    ready(children, "a")
    children.check()
    assert process_table.node_name(psutil.Process(children.pid("a"))) == "a"
    assert children.stop(["a"]) == []
    assert gone(children.pid("a"))


def test_of_several_that_ended_the_killed_one_is_named(children):
    children.start("plant", "failing")
    children.start("autopilot", "sleeper")
    ready(children, "autopilot")
    os.kill(children.pid("autopilot"), signal.SIGKILL)
    wait_for(lambda: not (children.running("plant") or children.running("autopilot")))
    with pytest.raises(NodeFailed, match="autopilot was killed by SIGKILL"):
        children.check()


def test_who_may_be_is_started_again_as_often_as_that(children):
    children.start("a", "sleeper", again=2)
    for left in (1, 0):
        ready(children, "a")
        pid = children.pid("a")
        os.kill(pid, signal.SIGKILL)
        wait_for(lambda: not children.running("a"))
        (lost,) = children.revive()
        assert lost.name == "a" and lost.status == -signal.SIGKILL
        assert children.running("a") and children.pid("a") != pid
        assert children._children["a"].again == left
        children.check()
    os.kill(children.pid("a"), signal.SIGKILL)
    wait_for(lambda: not children.running("a"))
    assert children.revive() == []
    with pytest.raises(NodeFailed, match="killed by SIGKILL"):
        children.check()


def test_who_is_started_again_may_get_further_arguments(children):
    children.start("a", "sleeper", ["first"], again=1)
    ready(children, "a")
    os.kill(children.pid("a"), signal.SIGKILL)
    wait_for(lambda: not children.running("a"))
    children.revive(lambda name: ["and", name])
    wait_for(lambda: "options first and a" in processes.tail(children._logs / "a.log"))


def test_a_stopped_child_is_not_started_again(children):
    children.start("a", "sleeper", again=1)
    ready(children, "a")
    children.stop(["a"])
    assert children.revive() == []


def test_a_child_that_ignores_signals_is_killed_in_time(children, monkeypatch):
    monkeypatch.setattr(processes, "INTERRUPT_WAIT", 0.2)
    monkeypatch.setattr(processes, "TERMINATE_WAIT", 0.2)
    children.start("b", "stubborn")
    ready(children, "b")
    assert children.stop(["b"]) == ["b"]
    assert gone(children.pid("b"))


def test_only_the_child_that_ignores_signals_is_named(children, monkeypatch):
    monkeypatch.setattr(processes, "INTERRUPT_WAIT", 20.0)
    children.start("a", "sleeper")
    children.start("b", "stubborn")
    ready(children, "a")
    ready(children, "b")
    children.hurry = lambda: not children.running("a")  # it may take its time to obey
    assert children.stop(["a", "b"]) == ["b"]
    assert gone(children.pid("a")) and gone(children.pid("b"))


def test_a_failure_names_the_node_the_reason_and_its_last_lines(children):
    children.start("position_controller", "failing")
    wait_for(lambda: not children.running("position_controller"))
    with pytest.raises(NodeFailed) as failure:
        children.check()
    assert "position_controller ended by itself with exit status 1" in str(failure.value)
    assert "one line before" in failure.value.last_lines
    assert failure.value.last_lines[-1] == "RuntimeError: no thrust curve"


def test_a_kill_from_outside_is_a_failure_that_names_the_signal(children):
    children.start("arm_controller", "sleeper")
    ready(children, "arm_controller")
    os.kill(children.pid("arm_controller"), signal.SIGKILL)
    wait_for(lambda: not children.running("arm_controller"))
    with pytest.raises(NodeFailed, match="arm_controller was killed by SIGKILL"):
        children.check()


def test_the_end_of_an_optional_child_is_reported_once_and_no_failure(children):
    children.start("scene", "sleeper", optional=True)
    children.start("other", "sleeper", optional=True)
    ready(children, "scene")
    assert children.missed() == []
    os.kill(children.pid("scene"), signal.SIGKILL)
    wait_for(lambda: not children.running("scene"))
    children.check()
    assert [str(failure) for failure in children.missed()] == ["scene was killed by SIGKILL"]
    children.stop(["other"])
    assert children.missed() == [], "reported once; a stopped child is not missed"


def test_a_stopped_child_is_named_while_it_is_stopped(children):
    made = children.start("a", "sleeper")
    children.start("b", "sleeper", optional=True)
    assert children.stopped() == []
    for name in ("a", "b"):
        os.kill(children.pid(name), signal.SIGSTOP)
    wait_for(children.stopped)
    (found,) = children.stopped()
    assert (found.name, found.status) == ("a", None)
    assert str(found) == "a is stopped (SIGSTOP) and does not go on"
    for name in ("a", "b"):
        os.kill(children.pid(name), signal.SIGCONT)
    wait_for(lambda: not children.stopped())
    assert made.status is None


def test_a_terminal_interrupt_does_not_reach_the_children(children):
    children.start("a", "sleeper")
    assert os.getpgid(children.pid("a")) != os.getpgid(0)


def test_a_terminal_interrupt_of_before_is_no_interrupt_of_the_child():
    with child.blocked(signal.SIGINT):
        signal.raise_signal(signal.SIGINT)
        child.obey_interrupts()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("stopped", [False, True])
def test_no_child_survives_a_killed_orchestrator(tmp_path, stopped):
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    path = os.pathsep.join([str(tmp_path), *sys.path])
    program = f"""
import os, pathlib, sys, time
from uam_lab.flights.processes.processes import Processes
folder = pathlib.Path({str(tmp_path)!r})
children = Processes(folder, {{**os.environ, "PYTHONPATH": {path!r}}})
children.start("a", "sleeper")
children.start("b", "sleeper")
print(children.pid("a"), children.pid("b"), flush=True)
time.sleep(60)
"""
    orchestrator = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True
    )
    pids = [int(word) for word in orchestrator.stdout.readline().split()]
    for name in ("a", "b"):
        wait_for(lambda name=name: "ready" in processes.tail(tmp_path / f"{name}.log"))
    if stopped:
        os.kill(pids[0], signal.SIGSTOP)
    orchestrator.kill()
    orchestrator.wait()
    orchestrator.stdout.close()
    wait_for(lambda: all(map(gone, pids)))


@pytest.mark.parametrize(
    "line",
    ["mujoco_sim: a port is in use", "[FATAL] [1795394174.460] [mujoco_sim]: a port is in use"],
)
def test_the_reason_of_a_failure_is_its_last_line_printed_or_logged(tmp_path, line):
    log = tmp_path / "mujoco_sim.log"
    log.write_text(f"something before\n{line}\n")
    failure = NodeFailed("mujoco_sim", 1, log)
    assert str(failure) == "mujoco_sim ended by itself with exit status 1: a port is in use"
