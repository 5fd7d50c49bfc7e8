"""Runs the processes of one flight: start, watch, restart what may be restarted, stop in order.

Its status comes by two topics, twice a second.
"""

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
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
from uam_lab.records.results.result_folder import ResultFolder
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.messages.status import WARN, AutopilotState, MissionStatus, diagnostic
from uam_msgs_py.node import wiring
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.namespace import prefix
from uam_msgs_py.node.polling import listen
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
        self._mission = listen(self.node, topics.MISSION_STATUS, EVERY_STATUS)
        self._autopilot = listen(self.node, topics.AUTOPILOT_STATE)
        rightful = RightfulNodes(self.node.get_namespace(), publishers)
        self.door = Door(self.node, tells=True)
        self.door.guard(self._mission, topics.MISSION_STATUS.name, rightful, lambda: False)
        self.door.guard(self._autopilot, topics.AUTOPILOT_STATE.name, rightful, lambda: False)
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
        self._subscription, self._door = listen(node, topics.CHANGES), door
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
        """Store a change if it was accepted."""
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


class Course(ExitStack):
    """What a kind of flight does besides: a context manager, polled while the flight goes on."""

    def goes_on(self) -> bool:
        """Do what is due; return whether the flight goes on."""
        raise NotImplementedError


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
    def ros_arguments(self) -> list[str]:
        """The ROS arguments that every node has."""
        # the nodes' output already contains their log messages; separate files would repeat them
        return [
            *(
                "--ros-args",
                "--disable-external-lib-logs",
                "-p",
                f"{PUBLISHERS}:={self.publishers}",
            ),
            *("--params-file", str(self.folder.parameters), "-r"),
            f"__ns:={self.settings.namespace}",
        ]

    def guest(self, name: str) -> Guest:
        """Return a further node in the flight's graph, for `with`."""
        common = node_arguments.common_remappings(self.settings)
        return Guest(name, self.surroundings, self.ports.domain, self.settings.namespace, common)


def run(
    flight: FlightRun,
    start: Callable[[Processes], None],
    announce: Callable[[Processes], Iterable[str]],
    course: Callable[[Processes, StatusListener], Course],
) -> tuple[NodeFailed | None, StatusListener | None]:
    """Start all processes, watch them while the course goes on, stop them.

    start: starts them; announce: returns lines about the start; course: see `Course`. Returns the
    failure, if any, and the listener with the newest status.
    """
    settings, folder, ports, observer, stop, publishers = flight
    common, listener = node_arguments.common_remappings(settings), None
    with Processes(folder.path / "logs", flight.surroundings) as children:
        children.hurry = lambda: stop.impatient
        try:
            start(children)
            for line in announce(children):
                observer.message(line)
            if settings.fused:
                observer.message(node_arguments.fused_line(settings))
            observer.message(f"for ros2 in another shell:\n{export_line(ports.domain)}")
            graph = flight.surroundings, ports.domain, settings.namespace, common
            with (
                StatusListener(*graph, publishers) as listener,
                course(children, listener) as running,
            ):
                observer.started(ports.domain)
                _watch(children, listener, flight, running)
        except NodeFailed as failure:
            return failure, listener
        finally:
            others = [name for name in children.names if name != wiring.RECORDER]
            disobedient = children.stop(others) + children.stop([wiring.RECORDER])
            if disobedient and not stop.impatient:
                observer.message(f"did not stop and were killed: {', '.join(disobedient)}")
    return None, listener


def _watch(
    children: Processes, listener: StatusListener, flight: FlightRun, course: Course
) -> None:
    """Show the progress while the flight goes on. Raises NodeFailed."""
    observer = flight.observer
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
    if not flight.stop.raised:
        children.check()
