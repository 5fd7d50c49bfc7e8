"""Cores of the processes of a lockstep flight."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from uam_control.settings.process_parameters import ProcessParameters
from uam_lab.flights.flight_options import BUILTIN
from uam_lab.flights.flight_settings import AUTOPILOT
from uam_lab.flights.ros.engine import NICE, pair, placing
from uam_msgs_py.node import wiring


def test_each_instance_has_two_cores():
    assert pair([0, 1], 0) == pair([0, 1], 7) == (0, 1)
    assert [pair([2, 3, 5, 8], n) for n in range(3)] == [(2, 3), (5, 8), (2, 3)]
    assert pair([1, 2, 4], 1) == (4, 1)
    assert pair([3], 0) is None


def settings(clock="lockstep", autopilot=BUILTIN, cores="", fifo=0):
    process = ProcessParameters(cores=cores, fifo_priority=fifo)
    return SimpleNamespace(clock=clock, autopilot=autopilot, process=process)


@pytest.fixture
def process():
    sleeping = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    yield sleeping.pid
    sleeping.kill()
    sleeping.communicate()


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core")
def test_who_computes_the_setpoint_has_one_core_and_the_others_the_second(process):
    first, second = pair(sorted(os.sched_getaffinity(0)), 0)
    for name in (wiring.FLIGHT_CONTROLLER, wiring.ESTIMATOR, wiring.BRIDGE):
        placing(settings(), 0, name)(process)
        assert os.sched_getaffinity(process) == {first}
    for name in (wiring.PLANT, wiring.MISSION, wiring.ARM, AUTOPILOT):
        placing(settings(), 0, name)(process)
        assert os.sched_getaffinity(process) == {second}
    assert os.sched_getscheduler(process) == os.SCHED_OTHER
    assert os.getpriority(os.PRIO_PROCESS, process) == os.getpriority(os.PRIO_PROCESS, 0)


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core")
@pytest.mark.parametrize("name", [wiring.RECORDER, "scene", "cockpit"])
def test_who_does_not_interrupt_the_tick_and_is_interrupted_by_it(process, name):
    placing(settings(), 0, name)(process)
    assert os.sched_getaffinity(process) == {pair(sorted(os.sched_getaffinity(0)), 0)[1]}
    assert os.sched_getscheduler(process) == os.SCHED_BATCH
    assert os.getpriority(os.PRIO_PROCESS, process) == max(NICE, os.getpriority(os.PRIO_PROCESS, 0))


def test_a_flight_that_gives_way_to_others_has_no_node_that_does_not(process):
    os.setpriority(os.PRIO_PROCESS, process, 19)
    placing(settings(), 0, wiring.RECORDER)(process)
    assert os.getpriority(os.PRIO_PROCESS, process) == 19


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core")
def test_plant_and_autopilot_have_the_priority_of_the_nodes_that_wait_for_them(process):
    try:
        os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(7))
    except PermissionError:
        pytest.skip("the system permits no real-time priority")
    for name in (wiring.PLANT, AUTOPILOT):
        os.sched_setscheduler(process, os.SCHED_OTHER, os.sched_param(0))
        placing(settings(fifo=7), 0, name)(process)
        assert os.sched_getscheduler(process) == os.SCHED_FIFO
        assert os.sched_getparam(process).sched_priority == 7
    placing(settings(fifo=7), 0, wiring.RECORDER)(process)
    assert os.sched_getscheduler(process) == os.SCHED_BATCH


def test_nothing_is_placed_in_real_time_with_another_autopilot_or_with_chosen_cores(process):
    before = os.sched_getaffinity(process)
    for one in (settings("realtime"), settings(autopilot="px4"), settings(cores="0")):
        placing(one, 0, wiring.PLANT)(process)
        assert os.sched_getaffinity(process) == before


def test_a_process_that_has_ended_is_no_error():
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    placing(settings(), 0, wiring.RECORDER)(ended.pid)
