"""The ROS engine: starts each node in a separate process and supervises the processes.

    ports → parameter file → processes → readiness → flight → stop in order → log → table

It releases all processes, ports and locks, also after an error.

In lockstep the processes of a tick wait for each other. A wake-up on the same core is cheaper than
one on another core, and the caches are warm. So what computes between sensors and setpoint has one
core, all others share a second one. Recorder, scene and cockpit do not interrupt those that the
tick waits for (SCHED_BATCH), and are interrupted by them (nice). Where the nodes that fly have a
real-time priority, plant and autopilot have it, too: they wait for each other.
"""

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from uam_control.profiles.profile import CONTROLLERS
from uam_lab.cockpit import page_address
from uam_lab.flights.flight_options import BUILTIN, ONLOOKERS
from uam_lab.flights.flight_settings import AUTOPILOT, FlightSettings
from uam_lab.flights.observer import Observer
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.processes.processes import Processes
from uam_lab.flights.ros import node_arguments, supervise
from uam_lab.flights.ros.process_fault_injection import ProcessFaults
from uam_lab.flights.ros.supervise import Course, FlightRun, StatusListener, read_outcome
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_msgs_py.node.namespace import prefix
from uam_sim_bridge.faults import PROCESS
from uam_sim_bridge.faults.timeline import FaultState
from uam_sim_bridge.nodes.fault_topic import FaultTopic
from uam_sim_bridge.nodes.plant_health import TICKS, WAITING
from uam_sim_bridge.nodes.plant_options import NOT_READY
from uam_sim_bridge.paced_clock import Patience
from uam_sim_bridge.ports import Reservation

LONGEST_STOP = 60.0  # [s] a process may be stopped; no time limit for one that runs
LOOK_PERIOD = 0.5  # [s] between two looks at the processes
SAY_PERIOD = 10.0  # [s] between two lines
LOCKSTEP = "lockstep"
FIRST_CORE = {
    wiring.FLIGHT_CONTROLLER,
    *(wiring.ESTIMATOR, wiring.POSITION, wiring.ATTITUDE, wiring.WHOLE_BODY, wiring.BRIDGE),
}
YIELDING = {wiring.RECORDER, *ONLOOKERS}
ANSWERING = {wiring.PLANT, AUTOPILOT}
NICE = 10  # of those that yield: a tenth of the core where the tick does not leave it to them


def pair(usable: Sequence[int], instance: int) -> tuple[int, int] | None:
    """Return two of the usable cores, other ones for the next instance; None if there is one."""
    if len(usable) < 2:
        return None
    first = 2 * instance % len(usable)
    return usable[first], usable[(first + 1) % len(usable)]


def placing(settings: FlightSettings, instance: int, name: str) -> Callable[[int], None]:
    """Return what places the process `name`, by its id, right after its start.

    It does nothing in real time, with an autopilot of its own threads, or with cores that the user
    has chosen (`--cores`).
    """
    cores = pair(sorted(os.sched_getaffinity(0)), instance)
    lockstep = settings.clock == "lockstep" and settings.autopilot == BUILTIN
    if cores is None or not lockstep or settings.process.cores:
        return lambda process: None

    def place(process: int) -> None:
        with contextlib.suppress(OSError):  # it has ended, or the system does not permit it
            os.sched_setaffinity(process, {cores[name not in FIRST_CORE]})
            if settings.process.fifo_priority and name in ANSWERING:
                priority = os.sched_param(settings.process.fifo_priority)
                os.sched_setscheduler(process, os.SCHED_FIFO, priority)
            if name in YIELDING:
                os.sched_setscheduler(process, os.SCHED_BATCH, os.sched_param(0))
                given = os.getpriority(os.PRIO_PROCESS, process)
                os.setpriority(os.PRIO_PROCESS, process, max(NICE, given))

    return place


class Waits:
    """Call `look` often: it says what the plant waits for."""

    def __init__(self, children: Processes, listener: StatusListener, observer: Observer) -> None:
        self._children, self._observer = children, observer
        self._door = listener.door
        self._plant = prefix(listener.node.get_namespace()) + wiring.PLANT
        self._diagnostics = self._door.listen(topics.DIAGNOSTICS)
        self._patience: dict[str, Patience] = {}  # of the stopped processes
        self._due = self._said = 0.0  # [s] time.monotonic()

    def look(self) -> None:
        """Say what is waited for; raise NodeFailed for a process that stays stopped."""
        now = time.monotonic()
        for message in self._door.messages(self._diagnostics):
            for status in message.status:
                begun = any(one.key == TICKS and one.value != "0" for one in status.values)
                if status.name == self._plant and status.message.startswith(WAITING) and begun:
                    self._say(f"the flight is {status.message}")
        if now < self._due:
            return
        self._due = now + LOOK_PERIOD
        stopped = self._children.stopped()
        self._patience = {
            one.name: self._patience.get(one.name) or Patience(LONGEST_STOP) for one in stopped
        }
        for one in stopped:
            left = self._patience[one.name].left
            if not left:
                raise one
            self._say(f"{one.name} is stopped (SIGSTOP): the flight waits {left:.0f} s for it")

    def _say(self, text: str) -> None:
        now = time.monotonic()
        if now - self._said >= SAY_PERIOD:
            self._said = now
            self._observer.message(text)


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
        supervise.prepare(node_arguments.modules(settings).values(), observer)
        ports = reservation.ports
        sections = node_arguments.parameters(settings, folder, ports)
        node_arguments.write(sections, settings, folder)
        if wiring.COCKPIT in sections:
            port = sections[wiring.COCKPIT]["port"]
            observer.message(f"cockpit: {page_address.address(page_address.LOCAL, port)}")
        publishers = node_arguments.publishers(settings)
        course = SimulatedCourse(FlightRun(settings, folder, ports, observer, stop, publishers))
        failure = supervise.run(course)
        if failure is not None and failure.status == NOT_READY and not settings.foreign:
            # on an overloaded machine the middleware may fail to connect all nodes
            observer.message(f"{failure}; starting again")
            _put_aside(folder)
            course = SimulatedCourse(course.flight)
            failure = supervise.run(course)
    outcome = read_outcome(settings, folder, failure, stop.raised)
    last = course.listener.newest if course.listener is not None else []
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


class SimulatedCourse(Course):
    """A flight in simulation: it goes on until the plant ends; faults of processes are injected.

    In lockstep a process that stays stopped ends it, see `Waits`.
    """

    def start(self) -> None:
        """Start the nodes, and an autopilot that is not the user's."""
        settings, ports, arguments = (
            self.flight.settings,
            self.flight.ports,
            self.flight.ros_arguments,
        )
        for name, module in node_arguments.modules(settings).items():
            self.children.start(
                name,
                module,
                arguments + node_arguments.process_remappings(settings, name),
                may_end=name == wiring.PLANT,
                optional=name in ONLOOKERS,
                again=supervise.RESTARTS if name in (*CONTROLLERS, wiring.WHOLE_BODY) else 0,
                nodes=node_arguments.nodes_in(name, settings),
                place=placing(settings, ports.instance, name),
            )
        module, own = node_arguments.autopilot(settings, self.flight.folder, ports)
        if module:
            place = placing(settings, ports.instance, AUTOPILOT)
            self.children.start(AUTOPILOT, module, own, may_end=True, place=place)

    def announcement(self) -> Iterator[str]:
        """Yield the ports, and what is waited for."""
        settings, ports = self.flight.settings, self.flight.ports
        yield (
            f"{len(self.children.names)} processes in ROS domain {ports.domain}, "
            f"autopilot on TCP {ports.simulator_tcp}, UDP {ports.autopilot_udp}"
        )
        if node_arguments.users_autopilot(settings):
            yield (
                "waiting for your autopilot; restart a PX4 that has served a flight: it does not "
                "connect again (px4_sitl restarts it by itself)"
            )
        for name in settings.foreign:
            own = settings.own_names.get(name, name)
            yield f"waiting for {own}: start it with ROS_DOMAIN_ID={ports.domain}"
        if not settings.auto_start and not settings.dry_run:
            real = settings.link is not None and settings.link.real
            why = ": a real autopilot arms by itself only with --arm" if real else ""
            yield f"waiting for uam start{why}"

    def begin(self) -> None:
        """Prepare the faults, and in lockstep the waits."""
        flight, lockstep = self.flight, self.flight.settings.clock == LOCKSTEP
        planned, self._topic = flight.settings.faults.only(PROCESS), None
        faults = ProcessFaults(self.children, planned, self._announce, lockstep=lockstep)
        self._faults = self.enter_context(faults)
        waits = Waits(self.children, self.listener, flight.observer) if lockstep else None
        self._waits: Waits | None = waits

    def goes_on(self) -> bool:
        """Begin and end the due faults; return whether the plant runs and nobody stops it.

        Raises NodeFailed.
        """
        stop, mission_time = self.flight.stop, self.listener.mission_time
        while not stop.injected.empty():
            self._faults.add(stop.injected.get(), mission_time or 0.0)
        self._faults.update(mission_time, self.listener.phase)
        if self._waits is not None:
            self._waits.look()
        return self.children.running(wiring.PLANT) and not stop.raised

    def _announce(self, one: FaultState) -> None:
        """Print and record the start or end of a fault."""
        stage = f"begins at {one.begin:.2f} s" if one.active else f"ends at {one.end:.2f} s"
        node = one.fault.to_mapping()["node"]
        process = self.children.process_of(node)
        affected = node if process == node else f"{node}, hence of the process {process},"
        self.flight.observer.message(f"fault {one.fault.NAME} of {affected} {stage}")
        self._topic = self._topic or FaultTopic(self.listener.node)  # made with the first fault
        self._topic.publish(self.listener.stamp, [one])
