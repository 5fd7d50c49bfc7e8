"""The engine of a flight on a vehicle: the nodes of a laboratory on the wall clock, no simulator.

ROS domain → parameter file → processes → devices → flight → stop in order → log → table

The flight goes on until the mission has ended. A first request to stop in the air becomes the
command land; a second one ends the nodes at once, and the autopilot's own failsafe acts.
"""

import time
from collections.abc import Collection, Iterable

from uam_control.profiles.profile import CONTROLLERS
from uam_control.settings.atomic import copy
from uam_control.supervision import State
from uam_lab.cockpit import page_address
from uam_lab.flights.flight_options import COCKPIT
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.observer import Observer
from uam_lab.flights.operator import NoFlight, Operator
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.ros import node_arguments, supervise
from uam_lab.flights.ros.supervise import Course, FlightRun, read_outcome
from uam_lab.flights.vehicle import vehicle_nodes
from uam_lab.flights.vehicle.devices import Report, devices
from uam_lab.flights.vehicle.lab_file import Lab
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_msgs_py.node.namespace import prefix
from uam_msgs_py.node.wiring import Connections
from uam_sim_bridge.ports import Reservation

LAB_COPY = "lab.yaml"
AGAIN = (
    *(*CONTROLLERS, wiring.WHOLE_BODY),
    *vehicle_nodes.DRIVERS,
    vehicle_nodes.CHECKLIST,
)  # nodes that are restarted after a loss
OPTIONAL = (COCKPIT, wiring.RECORDER)  # a vehicle in the air must not lose its control for a log
NOTHING_FLOWN = "nothing was flown: the mission had no state of the estimator; the log is kept"
LINGER = 4.0  # [s] after the mission, in which the autopilot disarms and closes its log
LOOK_PERIOD = 0.5  # [s] between two looks at the devices
REPEAT = 10.0  # [s] between two lines about nodes that are not connected
CONTROLLED = (State.TAKING_OFF, State.FLYING, State.HOLDING, State.LANDING)
NONE_CONNECTED: dict[str, int] = {}  # of the plant, which a vehicle has not


class VehicleCourse(Course):
    """The course of a vehicle's nodes: its devices, their connections, a landing by command."""

    without: Collection[str] = ()  # nodes that are not started
    optional: Collection[str] = OPTIONAL  # the flight continues without these

    def __init__(self, lab: Lab, flight: FlightRun) -> None:
        super().__init__(flight)
        self.lab, self._observer, self._stop = lab, flight.observer, flight.stop
        self._reports: dict[str, Report] = {}
        self._devices, self._wires = devices(lab), vehicle_nodes.wires(lab)
        self._look_at = self._said_at = 0.0  # [s] time.monotonic()
        self._connected = self._landing = False
        self._done_at: float | None = None

    def start(self) -> None:
        """Start the nodes; their parameters are in the flight's folder."""
        arguments, settings = self.flight.ros_arguments, self.flight.settings
        for name, module in vehicle_nodes.processes(self.lab).items():
            if name in self.without:
                continue
            again = supervise.RESTARTS if name in AGAIN else 0
            nodes = node_arguments.nodes_in(name, settings)
            how = {"optional": name in self.optional, "again": again, "nodes": nodes}
            self.children.start(name, module, arguments, **how)

    def announcement(self) -> Iterable[str]:
        """Return how to fly."""
        where = f"{len(self.children.names)} processes in ROS domain {self.flight.ports.domain}"
        to_fly = "to fly: uam checklist, then uam start; or both in the cockpit"
        return f"{where}; nothing arms by itself", to_fly

    def begin(self) -> None:
        """Listen to the diagnostics."""
        node = self.listener.node
        self._diagnostics = self.listener.door.listen(topics.DIAGNOSTICS)
        self._connections = Connections(node, spun=False)
        self._prefix = prefix(node.get_namespace())

    def goes_on(self) -> bool:
        """Look at devices and nodes; return whether the flight goes on."""
        now = time.monotonic()
        self._look(now)
        newest = self.listener.newest[-1] if self.listener.newest else None
        if newest is not None and newest.done and self._done_at is None:
            self._done_at = now
        if self._done_at is not None:
            return now - self._done_at < LINGER and not self._stop.impatient
        if not self._stop.raised:
            return True
        in_the_air = newest is not None and newest.state in [one.value for one in CONTROLLED]
        if self._stop.impatient or not in_the_air:
            return False
        self._land()
        return True

    def _look(self, now: float) -> None:
        """Take the diagnostics; every LOOK_PERIOD report the devices."""
        for message in self.listener.door.messages(self._diagnostics):
            self._connections.note(message)
            for status in message.status:
                name = status.name.removeprefix(self._prefix)
                values = {pair.key: pair.value for pair in status.values}
                self._reports[name] = Report(status.level, status.message, values)
        if now >= self._look_at:
            self._look_at = now + LOOK_PERIOD
            self._observer.bring_up([one.state(self._reports) for one in self._devices])
            self._look_at_connections(now)

    def _look_at_connections(self, now: float) -> None:
        """Report once that all nodes are connected, and now and then which are not."""
        if self._connected:
            return
        node = self.listener.node
        waiting = wiring.missing(node, True, self._wires) or list(
            wiring.unconnected(
                self._connections,
                NONE_CONNECTED,
                True,
                self._wires,
                (),
                node.get_namespace(),
                wiring.publishers(node),
            )
        )
        if not waiting:
            self._connected = True
            self._observer.message("all nodes are connected")
        elif self._said_at == 0.0:
            self._said_at = now + REPEAT
        elif now >= self._said_at:
            self._said_at = now + REPEAT
            more = f" and {len(waiting) - 1} more" if len(waiting) > 1 else ""
            self._observer.message(f"waiting for {waiting[0]}{more}")

    def _land(self) -> None:
        if self._landing:
            return
        self._landing = True
        self._observer.message("in the air: command land; once more: ends the nodes at once")
        try:
            with self.flight.guest("uam_landing") as guest:
                _, answer = Operator(guest.node).command("land")
        except NoFlight as error:
            answer = str(error)
        self._observer.message(f"land: {answer}")


def fly(
    lab: Lab,
    settings: FlightSettings,
    folder: ResultFolder,
    observer: Observer,
    stop: StopRequest,
) -> Outcome:
    """Start the nodes, record to `folder`; return when the mission or the user ends it.

    settings: see `settings_of`. Raises PortError, AddressError.
    """
    (folder.path / "logs").mkdir(exist_ok=True)
    if lab.file.is_file():
        copy(lab.file, folder.path / LAB_COPY)
    with Reservation(
        None, own_autopilot=False, domain=settings.domain, namespace=settings.namespace
    ) as reservation:
        supervise.prepare(vehicle_nodes.processes(lab).values(), observer)
        sections = vehicle_nodes.parameters(lab, settings, folder)
        node_arguments.write(sections, settings, folder)
        page = sections[wiring.COCKPIT]
        observer.message(f"cockpit: {page_address.address(page['host'], page['port'])}")
        publishers = vehicle_nodes.publishers(lab)
        flight = FlightRun(settings, folder, reservation.ports, observer, stop, publishers)
        failure = supervise.run(VehicleCourse(lab, flight))
    outcome = read_outcome(settings, folder, failure, stop.raised)
    if outcome.series is None and failure is None and stop.raised:
        outcome.failure = ""
        outcome.notes.append(NOTHING_FLOWN)
    return outcome
