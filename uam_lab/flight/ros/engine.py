"""The ROS engine: starts each node in a separate process and supervises the processes.

    ports → parameter file → processes → readiness → flight → stop in order → log → table

It releases all processes, ports and locks, also after an error.
"""

from __future__ import annotations

import time
from pathlib import Path

from uam_control.profiles.profile import CONTROLLERS
from uam_lab.cockpit import page_address
from uam_lab.flight.flight_settings import ONLOOKERS, FlightSettings
from uam_lab.flight.observer import FlightStatus, Observer
from uam_lab.flight.ros import node_arguments
from uam_lab.flight.ros.logged_outcome import read_outcome
from uam_lab.flight.ros.process_fault_injection import ProcessFaults
from uam_lab.flight.ros.restarts import ChangedParameters, RestartTopic
from uam_lab.flight.ros.status_listener import StatusListener
from uam_lab.processes import child
from uam_lab.processes.interrupts import StopRequest
from uam_lab.processes.node_environment import environment, export_line
from uam_lab.processes.process_table import await_orphans
from uam_lab.processes.processes import NodeFailed, Processes
from uam_lab.results.outcome import Outcome
from uam_lab.results.result_folder import ResultFolder
from uam_msgs_py.node import wiring
from uam_msgs_py.node.rightful import PARAMETER as PUBLISHERS
from uam_sim_bridge.faults import PROCESS
from uam_sim_bridge.faults.timeline import FaultState
from uam_sim_bridge.nodes.fault_topic import FaultTopic
from uam_sim_bridge.nodes.plant_options import NOT_READY
from uam_sim_bridge.ports import Ports, Reservation

AUTOPILOT = "autopilot"
FORKER = "uam_lab.flight.ros.forker"
RESTARTS = 3  # of each controller in a flight
POLL = 0.05  # [s]


def fly(
    settings: FlightSettings, folder: ResultFolder, observer: Observer, stop: StopRequest
) -> Outcome:
    """Fly, and record to `folder`; a failure or a requested stop keeps the recording so far.

    Raises PortError if no instance is free.
    """
    (folder.path / "logs").mkdir(exist_ok=True)
    own_autopilot = not node_arguments.users_autopilot(settings)
    with Reservation(
        settings.instance,
        own_autopilot=own_autopilot,
        domain=settings.domain,
        namespace=settings.namespace,
    ) as reservation:
        child.prepare([*node_arguments.modules(settings).values(), FORKER])
        await_orphans(observer.message)
        ports = reservation.ports
        sections = node_arguments.parameters(settings, folder, ports)
        folder.write_parameters(sections)
        node_arguments.write_facts(settings, folder)
        if wiring.COCKPIT in sections:
            port = sections[wiring.COCKPIT]["port"]
            observer.message(f"cockpit: {page_address.address(page_address.LOCAL, port)}")
        last: list[FlightStatus] = []
        failure = _supervise(settings, folder, ports, observer, stop, last)
        if failure is not None and failure.status == NOT_READY and not settings.foreign:
            # on an overloaded machine the middleware may fail to connect all nodes
            observer.message(f"{failure}; starting again")
            _put_aside(folder)
            failure = _supervise(settings, folder, ports, observer, stop, last)
    outcome = read_outcome(settings, folder, failure, stop.raised)
    if outcome.failure and failure is None and last and last[-1].time < 0.0:
        outcome.failure = f"no take-off ({outcome.failure}); autopilot {last[-1].autopilot}"
    return outcome


def _put_aside(folder: ResultFolder) -> None:
    """Move the logs of a failed start to logs/first_start/: the next one begins its own."""
    logs = folder.path / "logs"
    aside = logs / "first_start"
    aside.mkdir()
    recorded = (folder.log, folder.path / "metadata.yaml")
    for file in (*logs.glob("*.log"), *filter(Path.exists, recorded)):
        file.rename(aside / file.name)


def _supervise(
    settings: FlightSettings,
    folder: ResultFolder,
    ports: Ports,
    observer: Observer,
    stop: StopRequest,
    last: list[FlightStatus],
) -> NodeFailed | None:
    """Start all processes, watch them until the plant ends, stop them; return the failure.

    last: receives the newest status.
    """
    logs = folder.path / "logs"
    surroundings = environment(ports.domain, logs)
    common = node_arguments.common_remappings(settings)
    publishers = node_arguments.publishers(settings)
    with Processes(logs, surroundings) as children:
        children.hurry = lambda: stop.impatient
        try:
            _start(children, settings, folder, ports)
            observer.message(
                f"{len(children.names)} processes in ROS domain {ports.domain}, "
                f"autopilot on TCP {ports.simulator_tcp}, UDP {ports.autopilot_udp}"
            )
            observer.message(f"for ros2 in another shell:\n{export_line(ports.domain)}")
            for name in settings.foreign:
                own = settings.own_names.get(name, name)
                observer.message(f"waiting for {own}: start it with ROS_DOMAIN_ID={ports.domain}")
            if not settings.auto_start and not settings.dry_run:
                real = settings.link is not None and settings.link.real
                why = ": a real autopilot arms by itself only with --arm" if real else ""
                observer.message(f"waiting for uam start{why}")
            with (
                StatusListener(
                    surroundings, ports.domain, settings.namespace, common, publishers
                ) as listener,
                _process_faults(settings, children, listener, observer) as faults,
            ):
                observer.started(ports.domain)
                _watch(children, listener, observer, stop, faults)
                last[:] = listener.newest
        except NodeFailed as failure:
            return failure
        finally:
            others = [name for name in children.names if name != wiring.RECORDER]
            disobedient = children.stop(others) + children.stop([wiring.RECORDER])
            if disobedient and not stop.impatient:
                observer.message(f"did not stop and were killed: {', '.join(disobedient)}")
    return None


def _start(
    children: Processes, settings: FlightSettings, folder: ResultFolder, ports: Ports
) -> None:
    # the nodes' output already contains their log messages; separate files would repeat them
    arguments = ["--ros-args", "--disable-external-lib-logs"]
    arguments += ["-p", f"{PUBLISHERS}:={node_arguments.publishers(settings)}"]
    arguments += ["--params-file", str(folder.parameters), "-r", f"__ns:={settings.namespace}"]
    for name, module in node_arguments.modules(settings).items():
        children.start(
            name,
            module,
            arguments + node_arguments.remappings(settings, name),
            may_end=name == wiring.PLANT,
            optional=name in ONLOOKERS,
            again=RESTARTS if name in CONTROLLERS else 0,
        )
    module, own = node_arguments.autopilot(settings, folder, ports)
    if module:
        children.start(AUTOPILOT, module, own, may_end=True)


def _process_faults(
    settings: FlightSettings, children: Processes, listener: StatusListener, observer: Observer
) -> ProcessFaults:
    """Return the process faults; their start and end are printed and recorded."""
    schedule = settings.faults.only(PROCESS)
    topics: list[FaultTopic] = []  # made with the first fault

    def announce(one: FaultState) -> None:
        stage = f"begins at {one.begin:.2f} s" if one.active else f"ends at {one.end:.2f} s"
        observer.message(f"fault {one.fault.NAME} of {one.fault.values['node']} {stage}")
        if not topics:
            topics.append(FaultTopic(listener.node))
        topics[0].publish(listener.stamp, [one])

    return ProcessFaults(children, schedule, announce)


def _watch(
    children: Processes,
    listener: StatusListener,
    observer: Observer,
    stop: StopRequest,
    faults: ProcessFaults,
) -> None:
    """Show the progress until the plant ends or the user stops it. Raises NodeFailed."""
    restarts, changed = RestartTopic(listener.node), ChangedParameters(listener.node)
    while children.running(wiring.PLANT) and not stop.raised:
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
        while not stop.injected.empty():
            faults.add(stop.injected.get(), listener.mission_time or 0.0)
        faults.update(listener.mission_time)
        time.sleep(POLL)
    observer.finish()
    if not stop.raised:
        children.check()
