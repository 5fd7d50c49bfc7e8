"""Runs the processes of one flight: start, watch, restart what may be restarted, stop in order."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from typing import NamedTuple, Protocol

from uam_control.settings.configuration import ConfigurationError
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.observer import Observer
from uam_lab.flights.processes import child
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.processes.node_environment import environment, export_line
from uam_lab.flights.processes.process_table import await_orphans
from uam_lab.flights.processes.processes import NodeFailed, Processes
from uam_lab.flights.processes.shared_memory import shortage
from uam_lab.flights.ros import FORKER, node_arguments
from uam_lab.flights.ros.restarts import ChangedParameters, RestartTopic
from uam_lab.flights.ros.status_listener import StatusListener
from uam_lab.records.results.result_folder import ResultFolder
from uam_msgs_py.node import wiring
from uam_msgs_py.node.rightful import PARAMETER as PUBLISHERS
from uam_sim_bridge.ports import Ports

RESTARTS = 3  # of each node that may be restarted, in a flight
POLL = 0.05  # [s]


class Course(Protocol):
    """What a kind of flight does besides: a context manager, polled while the flight goes on."""

    def goes_on(self) -> bool:
        """Do what is due; return whether the flight goes on."""
        ...


def prepare(modules: Iterable[str], observer: Observer) -> None:
    """Begin to import the modules of the processes, unless `uam` has begun to; wait for the end of
    a killed flight's nodes. Raises ConfigurationError without room for shared memory."""
    if lack := shortage():
        raise ConfigurationError(lack)
    child.prepare([*modules, FORKER])
    await_orphans(observer.message)


class FlightRun(NamedTuple):
    """One flight as every engine over ROS has it."""

    settings: FlightSettings
    folder: ResultFolder
    ports: Ports
    observer: Observer
    stop: StopRequest


def run(
    flight: FlightRun,
    publishers: str,
    start: Callable[[Processes], None],
    announce: Callable[[Processes], Iterable[str]],
    course: Callable[[Processes, StatusListener], AbstractContextManager[Course]],
) -> tuple[NodeFailed | None, StatusListener | None]:
    """Start all processes, watch them while the course goes on, stop them.

    publishers: see `rightful`; start: starts them; announce: returns lines about the start;
    course: see `Course`. Returns the failure, if any, and the listener with the newest status.
    """
    settings, folder, ports, observer, stop = flight
    logs = folder.path / "logs"
    surroundings = environment(ports.domain, logs)
    common = node_arguments.common_remappings(settings)
    listener = None
    with Processes(logs, surroundings) as children:
        children.hurry = lambda: stop.impatient
        try:
            start(children)
            for line in announce(children):
                observer.message(line)
            if settings.fused:
                observer.message(node_arguments.fused_line(settings))
            observer.message(f"for ros2 in another shell:\n{export_line(ports.domain)}")
            namespace = settings.namespace
            with (
                StatusListener(
                    surroundings, ports.domain, namespace, common, publishers
                ) as listener,
                course(children, listener) as running,
            ):
                observer.started(ports.domain)
                _watch(children, listener, observer, stop, running)
        except NodeFailed as failure:
            return failure, listener
        finally:
            others = [name for name in children.names if name != wiring.RECORDER]
            disobedient = children.stop(others) + children.stop([wiring.RECORDER])
            if disobedient and not stop.impatient:
                observer.message(f"did not stop and were killed: {', '.join(disobedient)}")
    return None, listener


def ros_arguments(settings: FlightSettings, folder: ResultFolder, publishers: str) -> list[str]:
    """Return the ROS arguments that every node has; publishers: see `rightful`."""
    # the nodes' output already contains their log messages; separate files would repeat them
    arguments = ["--ros-args", "--disable-external-lib-logs", "-p", f"{PUBLISHERS}:={publishers}"]
    return [
        *arguments,
        *("--params-file", str(folder.parameters), "-r", f"__ns:={settings.namespace}"),
    ]


def _watch(
    children: Processes,
    listener: StatusListener,
    observer: Observer,
    stop: StopRequest,
    course: Course,
) -> None:
    """Show the progress while the flight goes on. Raises NodeFailed."""
    restarts = RestartTopic(listener.node)
    changed = ChangedParameters(listener.node, listener.door)
    while course.goes_on():
        changed.poll()
        for lost in children.revive(changed.arguments):
            text = f"{lost}; restarted"
            observer.message(text)
            restarts.publish(listener.stamp, lost.name, text)
        children.check()
        for failure in children.missed():
            observer.message(f"{failure}; the flight continues without it")
        for status in listener.poll():
            observer.update(status)
        time.sleep(POLL)
    observer.finish()
    if not stop.raised:
        children.check()
