"""Runs the processes of one flight: start, watch, restart what may be restarted, stop in order.

Its status comes by two topics, twice a second.
"""

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile

from uam_control.settings.configuration import ConfigurationError
from uam_control.stamps import SECOND
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.observer import FlightStatus, Observer
from uam_lab.flights.processes import child
from uam_lab.flights.processes.guest import Guest
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.processes.node_environment import environment, export_line
from uam_lab.flights.processes.process_table import await_orphans
from uam_lab.flights.processes.processes import NodeFailed, Processes
from uam_lab.flights.processes.shared_memory import shortage
from uam_lab.flights.ros import FORKER, node_arguments
from uam_lab.records.recording.log_reader import read_flight
from uam_lab.records.recording.logged_topics import RECORDER, losses
from uam_lab.records.recording.mcap_reader import UnreadableLog
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder, known_json
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.messages.status import WARN, AutopilotState, MissionStatus, diagnostic
from uam_msgs_py.node import wiring
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.namespace import prefix
from uam_msgs_py.node.rightful import PARAMETER as PUBLISHERS
from uam_msgs_py.node.rightful import RightfulNodes
from uam_sim_bridge.ports import Ports

RESTARTS = 3  # of each node that may be restarted, in a flight
POLL = 0.05  # [s]
# The topic keeps one message; here no change of phase may be lost between two polls.
EVERY_STATUS = QoSProfile(
    depth=topics.DEPTH,
    reliability=topics.MISSION_STATUS.qos.reliability,
    durability=topics.MISSION_STATUS.qos.durability,
)


class StatusListener(Guest):
    """Context manager with a node in a separate ROS context; polled, so it needs no executor."""

    def __init__(
        self,
        environment: Mapping[str, str],
        domain: int,
        namespace: str = "",
        arguments: Sequence[str] = (),
        publishers: str = "",
    ):
        """See `Guest`; publishers: the parameter of that name of the flight's nodes."""
        super().__init__(wiring.FLIGHT, environment, domain, namespace, arguments)
        rightful = RightfulNodes(self.node.get_namespace(), publishers)
        self.door = door = Door(self.node, tells=True)
        self._mission = door.listen(topics.MISSION_STATUS, EVERY_STATUS, rightful=rightful)
        self._autopilot = door.listen(topics.AUTOPILOT_STATE, rightful=rightful)
        self._state = AutopilotState()
        self._heard = False  # whether the autopilot's state is known
        self._last: tuple[float, float] | None = None  # simulated and wall time [s]
        self.newest: list[FlightStatus] = []  # at most one
        self.stamp, self.mission_time = 0, None  # [ns], [s] of the newest status after take-off
        self.phase = ""  # of that status

    def poll(self) -> list[FlightStatus]:
        """Return the status messages received since the last call."""
        for _, state in self.door.decoded(self._autopilot, AutopilotState.from_message):
            self._state, self._heard = state, True
        found = list(self.door.decoded(self._mission, self._status))
        self.newest = found[-1:] or self.newest
        return found

    def _status(self, message: DiagnosticArray) -> FlightStatus:
        stamp, mission = MissionStatus.from_message(message)
        if mission.time >= 0.0:
            self.stamp, self.mission_time, self.phase = stamp, mission.time, mission.phase
        state = self._state
        reasons = f": {state.reasons}" if state.reasons else ""
        return FlightStatus(
            phase=mission.phase,
            time=mission.time,
            position_error=mission.position_error,
            attitude_error=mission.attitude_error,
            arm_error=mission.arm_error,
            tilt=mission.tilt,
            real_time_factor=self._real_time_factor(stamp / SECOND),
            autopilot=f"{state.summary}{reasons}" if self._heard else "",
            state=mission.state,
            cause=mission.cause,
            released_to=state.released_to,
            done=mission.done,
        )

    def _real_time_factor(self, simulated: float) -> float:
        """Return simulated time / wall time since the first status."""
        wall = time.monotonic()
        if self._last is None:
            self._last = simulated, wall
        since = wall - self._last[1]
        return (simulated - self._last[0]) / since if since > 0.0 else 0.0


class ChangedParameters:
    """Subscription to /uam/parameter_changes; polled, so it needs no executor."""

    def __init__(self, node: Node, door: Door) -> None:
        """door: of the node."""
        self._subscription, self._door = door.listen(topics.CHANGES), door
        self._namespace = node.get_namespace()
        self._newest: dict[str, dict[str, Any]] = {}  # node → parameter → value

    def poll(self) -> None:
        """Store the received changes; only those that the node itself has sent."""
        own = prefix(self._namespace)
        for _, change in self._door.decoded(self._subscription, ParameterChange.from_message):
            # another sender could end the restart by an argument that the node refuses
            if self._door.sender(self._subscription) == f"/{own}{change.node}":
                self.note(change)

    def note(self, change: ParameterChange) -> None:
        if change.accepted:
            values = {name: new for name, (_, new) in change.values.items()}
            self._newest.setdefault(change.node, {}).update(values)

    def arguments(self, node: str) -> list[str]:
        """Return the ROS arguments with a node's newest values, to append to its arguments.

        Each value is given twice: that of a named node goes before the node's section of a
        parameter file, but ROS applies it only without a namespace.
        """
        values = self._newest.get(node, {}).items()
        pairs = [
            f"{to}{name}:={json.dumps(new)}" for name, new in values for to in ("", f"{node}:")
        ]
        return [text for pair in pairs for text in ("-p", pair)]


class RestartTopic:
    """Publishes a restart on /uam/restarts and /diagnostics, for plant, log and displays."""

    def __init__(self, node: Node) -> None:
        self._prefix = prefix(node.get_namespace())
        self._restarts = topics.RESTARTS.outlet(node)
        self._diagnostics = topics.DIAGNOSTICS.outlet(node)

    def publish(self, stamp: int, node: str, text: str) -> None:
        """Publish the restart of `node`; stamp [ns]: of the flight's clock."""
        self._restarts.publish(diagnostic(stamp, node, WARN, text, {}))
        self._diagnostics.publish(diagnostic(stamp, self._prefix + node, WARN, text, {}))


def prepare(modules: Iterable[str], observer: Observer) -> None:
    """Begin to import the modules of the processes, unless `uam` has begun to; wait for the end of
    a killed flight's nodes. Raises ConfigurationError without room for shared memory."""
    if lack := shortage():
        raise ConfigurationError(lack)
    child.prepare([*modules, FORKER])
    await_orphans(observer.message)


class FlightRun(NamedTuple):
    """One flight as every engine over ROS has it; publishers: of its topics, see `rightful`."""

    settings: FlightSettings
    folder: ResultFolder
    ports: Ports
    observer: Observer
    stop: StopRequest
    publishers: str

    @property
    def surroundings(self) -> dict[str, str]:
        """The variables of its processes."""
        return environment(self.ports.domain, self.folder.path / "logs")

    @property
    def graph(self) -> tuple[dict[str, str], int, str, list[str]]:
        """What a further node in the flight's graph has, see `Guest`."""
        common = node_arguments.common_remappings(self.settings)
        return self.surroundings, self.ports.domain, self.settings.namespace, common

    @property
    def ros_arguments(self) -> list[str]:
        """The ROS arguments that every node has."""
        # the nodes' output already contains their log messages; separate files would repeat them
        return [
            *(
                "--ros-args",
                "--disable-external-lib-logs",
                "-r",
                f"__ns:={self.settings.namespace}",
            ),
            *(
                "-p",
                f"{PUBLISHERS}:={self.publishers}",
                "--params-file",
                str(self.folder.parameters),
            ),
        ]

    def guest(self, name: str) -> Guest:
        """Return a further node in the flight's graph, for `with`."""
        return Guest(name, *self.graph)


class Course(ExitStack):
    """A kind of flight: its processes, and what it does while they run. A context manager."""

    children: Processes
    listener: StatusListener | None = None  # of its status, from the start of the processes on

    def __init__(self, flight: FlightRun) -> None:
        super().__init__()
        self.flight = flight

    def start(self) -> None:
        raise NotImplementedError

    def announcement(self) -> Iterable[str]:
        """Return lines about the start."""
        raise NotImplementedError

    def begin(self) -> None:
        """Prepare what needs the listener; what has to be left again is entered here."""

    def goes_on(self) -> bool:
        """Do what is due; return whether the flight goes on."""
        raise NotImplementedError


def run(course: Course) -> NodeFailed | None:
    """Start all processes of a flight, watch them while its course goes on, stop them."""
    flight = course.flight
    observer, stop = flight.observer, flight.stop
    with Processes(flight.folder.path / "logs", flight.surroundings) as children:
        children.hurry = lambda: stop.impatient
        course.children = children
        try:
            course.start()
            for line in course.announcement():
                observer.message(line)
            if flight.settings.fused:
                observer.message(node_arguments.fused_line(flight.settings))
            observer.message(f"for ros2 in another shell:\n{export_line(flight.ports.domain)}")
            with StatusListener(*flight.graph, flight.publishers) as course.listener, course:
                course.begin()
                observer.started(flight.ports.domain)
                _watch(course)
        except NodeFailed as failure:
            return failure
        finally:
            others = [name for name in children.names if name != wiring.RECORDER]
            disobedient = children.stop(others) + children.stop([wiring.RECORDER])
            if disobedient and not stop.impatient:
                observer.message(f"did not stop and were killed: {', '.join(disobedient)}")
    return None


def _watch(course: Course) -> None:
    """Show the progress while the flight goes on. Raises NodeFailed."""
    observer, children, listener = course.flight.observer, course.children, course.listener
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
    if not course.flight.stop.raised:
        children.check()


def read_outcome(
    settings: FlightSettings,
    folder: ResultFolder,
    failure: NodeFailed | None,
    interrupted: bool,
) -> Outcome:
    """Return the outcome of the flight in `folder`; failure: the failed node, if any."""
    logs, notes = folder.path / "logs", []
    numbers = known_json(logs / "mujoco_sim.json")
    realtime = settings.clock == "realtime"
    late, total = numbers.get("late_ticks", 0), numbers.get("answerable_ticks", 0)
    if late and realtime:
        notes.append(f"{late} of {total} setpoints were more than one control period late")
    outcome = logged(settings, folder, failure, interrupted, notes)
    if not outcome.errors_of:  # in simulation
        outcome.wall_s = numbers.get("wall_s", 0.0)
        outcome.latency_s = numbers.get("latency_s", []) if realtime else None
        outcome.missed_ticks = numbers.get("missed_ticks") if realtime else None
    if outcome.series is None or outcome.done or outcome.partial:
        return outcome
    full = known_json(logs / RECORDER).get("ended")
    ended = full or numbers.get("ended_by")
    if settings.dry_run and ended and not full:
        outcome.abort_reason = f"dry run, {ended}: nothing was armed"
    else:
        outcome.failure = ended or "the log has no end of the mission"
    return outcome


def logged(
    settings: FlightSettings,
    folder: ResultFolder,
    failure: NodeFailed | None,
    interrupted: bool,
    notes: list[str],
) -> Outcome:
    """Return what the log of a flight has; `notes` and the losses of the nodes come first."""
    try:
        outcome = read_flight(folder.log, settings.scenario, vehicle=settings.vehicle)
    except (UnreadableLog, OSError) as error:
        why = error if folder.log.exists() else "the flight ended before the recorder began"
        outcome = Outcome(series=None, failure=f"nothing recorded: {why}")
    outcome.interrupted = interrupted
    if failure is not None and not interrupted:
        outcome.failure, outcome.details = str(failure), failure.last_lines
    every = [*notes, *losses(folder.path / "logs"), *outcome.notes]
    outcome.notes = list(dict.fromkeys(every))
    return outcome
