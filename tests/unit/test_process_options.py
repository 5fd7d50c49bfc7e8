"""Options of a node's process: read, applied to every thread, refused with the remedy."""

import os
import subprocess
import sys
import textwrap

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from uam_control.settings.parameter_set import ParameterError
from uam_control.settings.process_parameters import ProcessParameters, cores_of
from uam_lab.flights.flight_settings import SettingsError, settings
from uam_msgs_py.node import process_options

# as a user without privileges, with the usual limits
UNPRIVILEGED = """
    import os, resource, sys, threading
    from uam_control.settings.parameter_set import ParameterError
    from uam_control.settings.process_parameters import ProcessParameters
    from uam_msgs_py.node.process_options import apply
    if os.getuid() == 0:
        os.setgid(65534)
        os.setuid(65534)
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
    resource.setrlimit(resource.RLIMIT_NICE, (0, 0))
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    try:
        apply(ProcessParameters.from_mapping(%r))
    except ParameterError as error:
        print(error)
    else:
        print("applied")
"""


def in_a_process(program: str) -> str:
    """Return the output of a program."""
    command = [sys.executable, "-c", textwrap.dedent(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@given(st.sets(st.integers(0, 63)))
def test_every_list_of_cores_is_read(cores):
    assert cores_of(",".join(map(str, cores))) == cores
    if cores:
        low, high = min(cores), max(cores)
        assert cores_of(f" {low}-{high} ") == set(range(low, high + 1))


@pytest.mark.parametrize("given", ["a", "3-1", "1-", "-1", "0-1024", "1;2"])
def test_what_is_no_list_of_cores_is_refused(given):
    with pytest.raises(ParameterError, match="cores: "):
        ProcessParameters.from_mapping({"cores": given})


def test_two_priorities_contradict_each_other():
    with pytest.raises(ParameterError, match="nice: -5 has no effect under SCHED_FIFO"):
        ProcessParameters.from_mapping({"fifo_priority": 10, "nice": -5})


def test_only_what_differs_from_the_defaults_is_a_change():
    assert ProcessParameters().changes() == {}
    assert ProcessParameters.from_mapping({"nice": 3}).changes() == {"nice": 3}


def test_the_options_reach_every_thread():
    core = min(os.sched_getaffinity(0))
    said = in_a_process(f"""
        import os, threading
        from uam_control.settings.process_parameters import ProcessParameters
        from uam_msgs_py.node.process_options import TASKS, apply
        end = threading.Event()
        threading.Thread(target=end.wait).start()
        apply(ProcessParameters(cores="{core}", nice=7))
        for task in map(int, (one.name for one in TASKS.iterdir())):
            print(sorted(os.sched_getaffinity(task)), os.getpriority(os.PRIO_PROCESS, task))
        end.set()
    """)
    assert set(said.splitlines()) == {f"[{core}] 7"} and len(said.splitlines()) > 1


@pytest.mark.parametrize(
    ("options", "refusal", "remedy"),
    [
        ({"fifo_priority": 50}, "fifo_priority: 50 is not permitted", "rtprio 80"),
        ({"nice": -5}, "nice: -5 is not permitted", "nice -20"),
        ({"lock_memory": True}, "lock_memory: only 0 MB may be locked", "memlock unlimited"),
    ],
)
def test_what_the_system_refuses_is_told_with_its_remedy(options, refusal, remedy):
    said = in_a_process(UNPRIVILEGED % options)
    assert said.startswith(refusal) and remedy in said and "\n" not in said


def test_a_core_that_is_not_there_is_refused():
    with pytest.raises(ParameterError, match="cores: 1023; this process may use 0"):
        process_options.try_out(ProcessParameters(cores="1023"))


def test_trying_out_changes_nothing_here():
    before, given = os.sched_getaffinity(0), os.getpriority(os.PRIO_PROCESS, 0)
    process_options.try_out(ProcessParameters(cores=str(min(before)), nice=max(5, given)))
    assert os.sched_getaffinity(0) == before and os.getpriority(os.PRIO_PROCESS, 0) == given


@pytest.mark.parametrize(
    ("options", "refusal"),
    [
        ({"process": {"cores": "1023"}}, "cores: 1023; this process may use"),
        ({"process": {"priority": 5}}, "priority: unknown, did you mean fifo_priority"),
        ({"process": {"nice": 3}, "engine": "direct"}, "the direct engine has no nodes"),
        ({"tick_times": True, "engine": "direct"}, "the direct engine has no nodes"),
    ],
)
def test_a_flight_is_refused_before_it_starts(options, refusal):
    with pytest.raises(SettingsError, match=refusal):
        settings(scenario="hover", **options)
