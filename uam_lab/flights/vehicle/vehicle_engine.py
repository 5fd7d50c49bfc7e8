"""The engine of a flight on a vehicle: the nodes of a laboratory on the wall clock, no simulator.

ROS domain → parameter file → processes → devices → flight → stop in order → log → table
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator

from uam_control.profiles.profile import CONTROLLERS
from uam_lab.cockpit import page_address
from uam_lab.flights.flight_options import COCKPIT
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.observer import Observer
from uam_lab.flights.processes.guest import Guest
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.processes.node_environment import environment
from uam_lab.flights.processes.processes import Processes
from uam_lab.flights.ros import node_arguments, supervise
from uam_lab.flights.ros.logged_outcome import read_outcome
from uam_lab.flights.ros.status_listener import StatusListener
from uam_lab.flights.vehicle import vehicle_nodes
from uam_lab.flights.vehicle.lab import Lab
from uam_lab.flights.vehicle.vehicle_course import VehicleCourse
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder
from uam_msgs_py.node import wiring
from uam_sim_bridge.ports import Ports, Reservation

LAB_COPY = "lab.yaml"
AGAIN = (
    *(*CONTROLLERS, wiring.WHOLE_BODY),
    *vehicle_nodes.DRIVERS,
    vehicle_nodes.CHECKLIST,
)  # nodes that are restarted after a loss
OPTIONAL = (COCKPIT, wiring.RECORDER)  # a vehicle in the air must not lose its control for a log
NOTHING_FLOWN = "nothing was flown: the mission had no state of the estimator; the log is kept"


class VehicleEngine:
    """`fly` is an engine of `library.Flight`."""

    def __init__(self, lab: Lab) -> None:
        self._lab = lab

    def fly(
        self, settings: FlightSettings, folder: ResultFolder, observer: Observer, stop: StopRequest
    ) -> Outcome:
        """Start the nodes, record to `folder`; return when the mission or the user ends it.

        settings: see `settings_of`. Raises PortError, AddressError.
        """
        lab = self._lab
        (folder.path / "logs").mkdir(exist_ok=True)
        if lab.file.is_file():
            shutil.copy(lab.file, folder.path / LAB_COPY)
        with Reservation(
            None, own_autopilot=False, domain=settings.domain, namespace=settings.namespace
        ) as reservation:
            supervise.prepare(vehicle_nodes.processes(lab).values(), observer)
            ports = reservation.ports
            sections = vehicle_nodes.parameters(lab, settings, folder)
            node_arguments.write(sections, settings, folder)
            page = sections[wiring.COCKPIT]
            observer.message(f"cockpit: {page_address.address(page['host'], page['port'])}")
            logs, publishers = folder.path / "logs", vehicle_nodes.publishers(lab)
            common = node_arguments.common_remappings(settings)

            def guest(name: str) -> Guest:
                surroundings = environment(ports.domain, logs)
                return Guest(name, surroundings, ports.domain, settings.namespace, common)

            def course(_: Processes, listener: StatusListener) -> VehicleCourse:
                return VehicleCourse(lab, listener, guest, observer, stop)

            failure, _ = supervise.run(
                supervise.FlightRun(settings, folder, ports, observer, stop),
                publishers,
                lambda children: start_nodes(children, lab, settings, folder, publishers),
                lambda children: _announcement(children, ports),
                course,
            )
        outcome = read_outcome(settings, folder, failure, stop.raised)
        if outcome.series is None and failure is None and stop.raised:
            outcome.failure = ""
            outcome.notes.append(NOTHING_FLOWN)
        return outcome


def start_nodes(
    children: Processes,
    lab: Lab,
    settings: FlightSettings,
    folder: ResultFolder,
    publishers: str,
    without: Collection[str] = (),
    optional: Collection[str] = OPTIONAL,
) -> None:
    """Start the nodes of a vehicle except `without`; their parameters are in `folder`.

    optional: the flight continues without these.
    """
    arguments = supervise.ros_arguments(settings, folder, publishers)
    for name, module in vehicle_nodes.processes(lab).items():
        if name in without:
            continue
        again = supervise.RESTARTS if name in AGAIN else 0
        nodes, missed = node_arguments.nodes_in(name, settings), name in optional
        children.start(name, module, arguments, optional=missed, again=again, nodes=nodes)


def _announcement(children: Processes, ports: Ports) -> Iterator[str]:
    yield f"{len(children.names)} processes in ROS domain {ports.domain}; nothing arms by itself"
    yield "to fly: uam checklist, then uam start; or both in the cockpit"
