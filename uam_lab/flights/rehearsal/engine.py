"""The engine of a rehearsal: laboratory and autopilot first, then the vehicle's nodes.

    ports → lab file → laboratory → autopilot → nodes → lists → start → flight → log → table

It releases all processes, devices and ports, also after an error.
"""

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from uam_lab.flights.flight_settings import AUTOPILOT, FlightSettings
from uam_lab.flights.observer import Observer
from uam_lab.flights.operator import DECODE, NoFlight, Operator
from uam_lab.flights.processes.guest import Guest
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.processes.processes import NodeFailed
from uam_lab.flights.rehearsal import device_figures, laboratory_process
from uam_lab.flights.rehearsal.laboratory_process import LABORATORY, LABORATORY_MODULE
from uam_lab.flights.ros import node_arguments, supervise
from uam_lab.flights.ros.supervise import FlightRun, logged
from uam_lab.flights.vehicle import vehicle_nodes
from uam_lab.flights.vehicle.lab_file import Lab, settings_of
from uam_lab.flights.vehicle.vehicle_engine import VehicleCourse
from uam_lab.flights.vehicle.vehicle_nodes import CHECKLIST
from uam_lab.records.recording.logged_topics import LABORATORY_FILE
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder, known_json, write_json
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_msgs_py.node.door import Door
from uam_sim_bridge.nodes.laboratory import READY
from uam_sim_bridge.ports import Reservation

LOOK = 0.2  # [s] between two looks
AGAIN = 1.0  # [s] between two requests to start
PATIENCE = 60.0  # [s] without progress until the start counts as refused


class Starter(threading.Thread):
    """Context manager. `started`: the mission has accepted; `refused`: why not, "" while it tries.

    `waits_for`: what it waits for now, one line.
    """

    def __init__(self, guest: Callable[[str], Guest], checklist: bool) -> None:
        """guest: name → node in the flight's ROS domain; checklist: wait for the lists."""
        super().__init__(name="starter", daemon=True)
        self._guest, self._required = guest, checklist
        self._ended = threading.Event()
        self.started, self.refused, self.waits_for = False, "", "the nodes"

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self.join()

    def run(self) -> None:
        """Watch the lists, request the start."""
        with self._guest("uam_rehearse") as guest:
            operator, door = Operator(guest.node), Door(guest.node, tells=True)
            lists = door.listen(topics.CHECKLIST)
            passed, most = not self._required, -1
            progress, asked = time.monotonic(), 0.0
            while not self._ended.wait(LOOK) and not self.started:
                now = time.monotonic()
                for (_, state), items in door.decoded(lists, DECODE[topics.CHECKLIST]):
                    passed, self.waits_for = passed or state.passed, state.summary
                    count = sum(bool(item.passed) for item in items)
                    if count > most:  # not those that come and go
                        most, progress = count, now
                if now - progress > PATIENCE:
                    self.refused = self.waits_for
                    return
                if passed and now - asked >= AGAIN:
                    asked = now
                    try:
                        self.started, self.waits_for = operator.command("start")
                    except NoFlight as error:
                        self.waits_for = str(error)


REFUSED = "start refused: "
LOGS = "logs"  # in the result folder
POLL = 0.05  # [s]
SAY_PERIOD = 5.0  # [s] between two lines about the lists
DEVICES_WAIT = 60.0  # [s] until the laboratory has its devices
# items about the companion of the vehicle and the pilot's radio, which a rehearsal has not
ABSENT = {"clock_synchronised": False, "performance_governor": False, "radio": False}
OWN = (LABORATORY, AUTOPILOT)  # their end is no refused start


def read_outcome(
    settings: FlightSettings,
    folder: ResultFolder,
    failure: NodeFailed | None,
    refused: str,
    interrupted: bool,
) -> Outcome:
    """Return the outcome of the rehearsal in `folder`.

    failure: the failed node, if any; refused: why the mission was not started, "" if it was.
    """
    numbers = known_json(folder.path / LOGS / LABORATORY_FILE)
    lost = numbers.get("lost_s")
    notes = [f"the plant could not keep real time: {lost:.2f} s lost"] if lost else []
    outcome = logged(settings, folder, failure, interrupted, notes)
    if refused:
        outcome.failure, outcome.details = REFUSED + refused, ()
    outcome.wall_s = float(numbers.get("wall_s", 0.0))
    if outcome.series is None:
        return outcome
    if not outcome.done and not outcome.partial:
        outcome.failure = numbers.get("ended_by") or "the mission did not end"
    return outcome


def _prepare_checklist(sections: dict[str, dict[str, Any]], required: bool) -> None:
    """Leave out what this computer and the stand-in cannot have; not required: all of the list."""
    if not required:
        sections[wiring.MISSION].pop("require_checklist", None)
        sections.pop(CHECKLIST, None)
    elif CHECKLIST in sections:
        sections[CHECKLIST] = ABSENT | sections[CHECKLIST]


class RehearsalCourse(VehicleCourse):
    """That of the vehicle, with a laboratory that ends it and a person who starts it.

    refused: why the mission was not started, "" if it was; started: whether it has accepted.
    """

    optional = (wiring.COCKPIT,)  # a rehearsal is judged by its log

    def __init__(self, lab: Lab, flight: FlightRun, checklist: bool) -> None:
        super().__init__(lab, flight)
        self.refused, self.started = "", False
        self._lists = checklist and CHECKLIST in vehicle_nodes.modules(lab)
        self.without = () if self._lists else (CHECKLIST,)
        self._said, self._say_at = "", 0.0  # [s] time.monotonic()

    def start(self) -> None:
        """Start laboratory and autopilot; where devices are there, the nodes. Raises NodeFailed."""
        flight, children = self.flight, self.children
        devices = devices_of(flight.folder)
        children.start(LABORATORY, LABORATORY_MODULE, flight.ros_arguments, may_end=True)
        patience = time.monotonic() + DEVICES_WAIT
        while not (devices / READY).exists():
            children.check()
            if not children.running(LABORATORY) or time.monotonic() > patience:
                log = flight.folder.path / LOGS / f"{LABORATORY}.log"
                raise NodeFailed(LABORATORY, 0, log)
            if flight.stop.raised:
                return
            time.sleep(POLL)
        module, own = laboratory_process.autopilot(
            self.lab, flight.settings, devices, flight.folder.path, flight.ports
        )
        children.start(AUTOPILOT, module, own, may_end=True)
        super().start()

    def announcement(self) -> Iterable[str]:
        """Return where the devices are."""
        where = f"{len(self.children.names)} processes in ROS domain {self.flight.ports.domain}"
        return (f"{where}; devices in {devices_of(self.flight.folder)}",)

    def begin(self) -> None:
        super().begin()
        self._starter = self.enter_context(Starter(self.flight.guest, self._lists))

    def goes_on(self) -> bool:
        """Return whether the laboratory and the vehicle's flight go on."""
        starter = self._starter
        vehicle = super().goes_on()
        self.started, self.refused = starter.started, starter.refused
        now = time.monotonic()
        if starter.waits_for != self._said and not starter.started and now >= self._say_at:
            self._said, self._say_at = starter.waits_for, now + SAY_PERIOD
            self.flight.observer.message(f"before the start: {self._said}")
        # the starter decides in a thread of its own: what ends the rehearsal is what was stored
        return vehicle and not self.refused and self.children.running(LABORATORY)


def devices_of(folder: ResultFolder) -> Path:
    return (folder.path / "devices").absolute()


def fly(
    given: Lab,
    settings: FlightSettings,
    folder: ResultFolder,
    observer: Observer,
    stop: StopRequest,
    checklist: bool = True,
) -> Outcome:
    """Rehearse, and record to `folder`; a failure or a requested stop keeps the recording.

    checklist: whether the lists are required and a person does them. Raises PortError, LabError.
    """
    logs, devices = folder.path / LOGS, devices_of(folder)
    for each in (logs, devices):
        each.mkdir(exist_ok=True)
    with Reservation(None, own_autopilot=False) as reservation:
        ports = reservation.ports
        document = laboratory_process.emulated_lab(given, devices, device_figures.free_udp_port())
        lab = laboratory_process.write_lab(document, given.file, folder.path)
        own = settings_of(lab, settings.command)
        settings = replace(settings, link=own.link, autopilot=own.autopilot)
        modules = vehicle_nodes.processes(lab)
        supervise.prepare([*modules.values(), LABORATORY_MODULE], observer)
        sections = vehicle_nodes.parameters(lab, settings, folder)
        required = laboratory_process.required_parameters(settings.px4, logs)
        sections[wiring.BRIDGE] = required | sections[wiring.BRIDGE]
        _prepare_checklist(sections, checklist)
        sections[LABORATORY] = laboratory_process.parameters(
            lab, settings, devices, logs, ports, checklist
        )
        node_arguments.write(sections, settings, folder)
        publishers = vehicle_nodes.publishers(lab)
        flight = FlightRun(settings, folder, ports, observer, stop, publishers)
        course = RehearsalCourse(lab, flight, checklist)
        failure = supervise.run(course)
    refused = course.refused
    if failure is not None and not course.started and failure.name not in OWN:
        refused = refused or str(failure)
    outcome = read_outcome(settings, folder, failure, refused, stop.raised)
    figures = device_figures.read(folder.log, logs)
    write_json(folder.path / device_figures.NAME, figures)
    if not settings.faults:
        rate = 1.0 / settings.vehicle.control_period
        outcome.notes += device_figures.slow_computer(figures, rate)
    return outcome
