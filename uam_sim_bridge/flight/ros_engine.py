"""The ROS engine: every node a process of its own, supervised from here.

    ports → parameter file → processes → readiness → flight → stop in order → log → table

Nothing is left behind, however it ends: no process, port, lock or shared memory.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from uam_control.profile import CONTROLLERS
from uam_sim_bridge.cockpit import place
from uam_sim_bridge.faults import LINK, PLANT, PROCESS
from uam_sim_bridge.faults.timeline import Happened
from uam_sim_bridge.flight import child, log_facts, shared_memory, wiring
from uam_sim_bridge.flight.changed_parameters import ChangedParameters
from uam_sim_bridge.flight.conclude import asked, command_line
from uam_sim_bridge.flight.fault_log import FaultTopic
from uam_sim_bridge.flight.interrupts import Interrupts
from uam_sim_bridge.flight.limits import time_limit
from uam_sim_bridge.flight.log_reader import read_flight
from uam_sim_bridge.flight.mcap_reader import UnreadableLog
from uam_sim_bridge.flight.outcome import Outcome
from uam_sim_bridge.flight.places import Places
from uam_sim_bridge.flight.ports import Ports, Reservation
from uam_sim_bridge.flight.process_faults import ProcessFaults
from uam_sim_bridge.flight.process_table import await_orphans
from uam_sim_bridge.flight.processes import NodeFailed, Processes, environment
from uam_sim_bridge.flight.progress import Progress
from uam_sim_bridge.flight.restart_log import RestartTopic
from uam_sim_bridge.flight.result_folder import ResultFolder, as_json, versions
from uam_sim_bridge.flight.settings import BUILTIN, ONLOOKERS, FlightSettings
from uam_sim_bridge.flight.status_listener import StatusListener
from uam_sim_bridge.flight.warm_up import is_cold, warm_up
from uam_sim_bridge.nodes.plant_options import NOT_READY

# Executable → module. Started and, at the end, stopped in this order, the recorder last.
MODULES = {
    wiring.RECORDER: "uam_sim_bridge.nodes.recorder",
    wiring.PLANT: "uam_sim_bridge.nodes.mujoco_sim",
    wiring.ESTIMATOR: "uam_control.nodes.state_estimator",
    wiring.MISSION: "uam_control.nodes.mission",
    wiring.POSITION: "uam_control.nodes.position_controller",
    wiring.ATTITUDE: "uam_control.nodes.attitude_controller",
    wiring.ARM: "uam_control.nodes.arm_controller",
    wiring.BRIDGE: "uam_sim_bridge.nodes.mavlink_bridge",
    wiring.SCENE: "uam_sim_bridge.nodes.scene",
    wiring.COCKPIT: "uam_sim_bridge.nodes.cockpit",
}
AUTOPILOT = "autopilot"
FACTS = "facts.json"
FORKER = "uam_sim_bridge.flight.forker"
# Each child imports its parent's main module anew, as a rule the command and these.
COMMANDS = [
    f"uam_sim_bridge.cli.{name}"
    for name in "campaign compare doctor faults fly profile report tune view".split()
]
STAND_IN, SITL = "uam_sim_bridge.autopilot.server", "uam_sim_bridge.px4.sitl"
HITL_ROUTER = "uam_sim_bridge.mavlink.router"
PX4_LOG = "px4.ulg"
PX4_LINGER = 4.0  # [s] simulated, after the mission, in which PX4 disarms and closes its log
START_TIMEOUT = 20.0  # [s] without progress until every node is connected to the others
AUTOPILOT_WAIT = 60.0  # [s] of the autopilot for the simulator
OWN_START_TIMEOUT = 600.0  # [s] the same where the user is to start one by hand
ANSWER_TIMEOUT = 10.0  # [s] for the answers to one lockstep tick
RESTARTS = 3  # of each controller in a flight
POLL = 0.05  # [s]
NOTE_PERIOD = 1.0  # [s] between two looks at the shared memory that the nodes use


def fly(settings: FlightSettings, folder: ResultFolder, progress: Progress) -> Outcome:
    """Fly; what was recorded lies in `folder` afterwards, also after a failure or Ctrl-C.

    Raises PortError when no instance is free.
    """
    (folder.path / "logs").mkdir(exist_ok=True)
    with (
        Reservation(settings.instance, own_autopilot=not _started(settings)) as reservation,
        shared_memory.Presence() as presence,
    ):
        if is_cold():
            progress.message("compiling the control path (once)")
            warm_up()
        child.prepare([*_modules(settings).values(), FORKER, *COMMANDS])
        await_orphans(progress.message)
        presence.remove_unused(shared_memory.abandoned())
        with Interrupts() as stop:
            ports = reservation.ports
            sections = parameters(settings, folder, ports)
            folder.write_parameters(sections)
            _write_facts(settings, folder)
            if wiring.COCKPIT in sections:
                port = sections[wiring.COCKPIT]["port"]
                progress.message(f"cockpit: {place.address(place.LOCAL, port)}")
            failure = _supervise(settings, folder, ports, progress, stop, presence)
            if failure is not None and failure.status == NOT_READY and not settings.foreign:
                # on a machine without processor time the middleware may not connect all of them
                progress.message(f"{failure}; starting once more")
                _keep_logs(folder.path / "logs")
                failure = _supervise(settings, folder, ports, progress, stop, presence)
    outcome = _outcome(settings, folder, failure, stop.raised)
    last = progress.last
    if outcome.failure and failure is None and last is not None and last.time < 0.0:
        outcome.failure = f"no take-off ({outcome.failure}); autopilot {last.autopilot}"
    return outcome


def _keep_logs(logs: Path) -> None:
    """Put aside what a start in vain has said."""
    aside = logs / "first_start"
    aside.mkdir()
    for file in logs.glob("*.log"):
        file.rename(aside / file.name)


def parameters(
    settings: FlightSettings, folder: ResultFolder, ports: Ports
) -> dict[str, dict[str, Any]]:
    """Every node's parameters: those of the profile, and those of this flight."""
    sections = {node: values.to_mapping() for node, values in settings.profile.sets.items()}
    sections[wiring.MISSION]["scenario"] = _scenario(settings)
    sections[wiring.PLANT] = {
        "vehicle_changes": json.dumps(settings.vehicle_changes),
        "payload_mass": float(settings.payload_mass),
        "seed": settings.seed,
        "arm_start": list(settings.scenario.arm_start),
        "clock": settings.clock,
        "hil_port": ports.simulator_tcp,
        "autopilot_always_answers": settings.autopilot == BUILTIN,
        "linger": 0.0 if settings.autopilot == BUILTIN else PX4_LINGER,
        "recorded": True,
        "start_timeout": OWN_START_TIMEOUT if settings.foreign else START_TIMEOUT,
        "foreign": ",".join(settings.foreign),
        "faults": settings.faults.only(PLANT).to_text(),
        "answer_timeout": ANSWER_TIMEOUT,
        "time_limit": time_limit(settings.scenario),
        "statistics": str(folder.path / "logs" / "mujoco_sim.json"),
    }
    sections[wiring.BRIDGE] = settings.profile.bridge() | {
        "clock": settings.clock,
        "local_port": ports.offboard_udp,
        "autopilot_port": ports.autopilot_udp,
        # as PX4 SITL numbers its instances; a flight controller is the first of its kind
        "autopilot_system": 1.0 if _in_the_loop(settings) else float(ports.instance + 1),
        "gcs": settings.gcs,
        "faults": settings.faults.only(LINK).to_text(),
    }
    if _started(settings):
        sections[wiring.BRIDGE]["autopilot"] = settings.autopilot
    sections[wiring.SCENE] = {"scenario": _scenario(settings)}
    if wiring.COCKPIT not in settings.without:
        sections[wiring.COCKPIT] = {"port": place.free_port(place.LOCAL, place.PORT)}
    sections[wiring.RECORDER] = {
        "file": str(folder.log),
        "statistics": str(folder.path / "logs" / "recorder.json"),
        "facts": str(folder.path / "logs" / FACTS),
        "size_limit": settings.log_limit,
    }
    return sections


def _write_facts(settings: FlightSettings, folder: ResultFolder) -> None:
    """What the log is to say about the flight, apart from what flies by."""
    texts = {
        folder.parameters.name: folder.parameters.read_text(),
        folder.versions.name: as_json(versions()),
    }
    known = asked(settings, command_line())
    log_facts.write(folder.path / "logs" / FACTS, known, _scenario(settings), texts)


def _scenario(settings: FlightSettings) -> str:
    """What the mission node is told to load: a name, or a file wherever the node runs."""
    given = Path(settings.scenario_source)
    return str(given.absolute()) if given.suffix else settings.scenario_source


def _supervise(
    settings: FlightSettings,
    folder: ResultFolder,
    ports: Ports,
    progress: Progress,
    stop: Interrupts,
    presence: shared_memory.Presence,
) -> NodeFailed | None:
    """Start everything, watch it until the plant ends, stop it; returns what failed."""
    logs = folder.path / "logs"
    surroundings = environment(ports.domain, logs)
    with (
        Places(ports.domain) as places,
        Processes(logs, surroundings, presence.remove_unused, places.occupy) as children,
    ):
        children.hurry = lambda: stop.impatient
        try:
            _start(children, settings, folder, ports)
            progress.message(
                f"{len(children.names)} processes in ROS domain {ports.domain}, "
                f"autopilot on TCP {ports.simulator_tcp}, UDP {ports.autopilot_udp}"
            )
            for name in settings.foreign:
                progress.message(
                    f"waiting for your {name}, to be started with ROS_DOMAIN_ID={ports.domain}"
                )
            with (
                StatusListener(surroundings, ports.domain) as listener,
                _process_faults(settings, children, listener, progress) as faults,
            ):
                _watch(children, listener, progress, stop, faults)
        except NodeFailed as failure:
            return failure
        finally:
            children.note_shared_memory()
            others = [name for name in children.names if name != wiring.RECORDER]
            disobedient = children.stop(others) + children.stop([wiring.RECORDER])
            if disobedient and not stop.impatient:
                progress.message(f"had to be killed: {', '.join(disobedient)}")
    return None


def _start(
    children: Processes, settings: FlightSettings, folder: ResultFolder, ports: Ports
) -> None:
    # What the nodes log is in their output already; files of their own would repeat it.
    arguments = ["--ros-args", "--disable-external-lib-logs"]
    arguments += ["--params-file", str(folder.parameters)]
    for name, module in _modules(settings).items():
        children.start(
            name,
            module,
            arguments,
            may_end=name == wiring.PLANT,
            optional=name in ONLOOKERS,
            again=RESTARTS if name in CONTROLLERS else 0,
        )
    module, own = _autopilot(settings, folder, ports)
    if module:
        children.start(AUTOPILOT, module, own, may_end=True)


def _modules(settings: FlightSettings) -> dict[str, str]:
    """The nodes of a flight: executable → module."""
    return {name: module for name, module in MODULES.items() if name not in settings.without}


def _in_the_loop(settings: FlightSettings) -> bool:
    """Whether a flight controller flies the simulated vehicle, all over one serial line."""
    return settings.link is not None and settings.link.kind == "serial"


def _started(settings: FlightSettings) -> bool:
    """Whether the user has started the autopilot, which connects to the plant by itself."""
    return settings.link is not None and not _in_the_loop(settings)


def _autopilot(
    settings: FlightSettings, folder: ResultFolder, ports: Ports
) -> tuple[str, list[str]]:
    """Module and arguments of the autopilot's process; no module where the user started one."""
    instance = ["--instance", str(ports.instance)]
    patience = ["--wait", str(AUTOPILOT_WAIT)]
    if _in_the_loop(settings):
        return HITL_ROUTER, [settings.autopilot, *instance, *patience]
    if settings.px4 is not None:
        log = folder.path / PX4_LOG
        own = ["--px4-dir", str(settings.px4.directory), "--log", str(log.absolute())]
        return SITL, [*instance, *own]
    if _started(settings):
        return "", []
    return STAND_IN, [*instance, *patience]


def _process_faults(
    settings: FlightSettings, children: Processes, listener: StatusListener, progress: Progress
) -> ProcessFaults:
    """What hinders the processes; each time it is said, and told to the log."""
    schedule = settings.faults.only(PROCESS)
    topic = FaultTopic(listener.node) if schedule else None

    def tell(one: Happened) -> None:
        stage = f"begins at {one.begin:.2f} s" if one.active else f"is over at {one.end:.2f} s"
        progress.message(f"fault {one.fault.NAME} of {one.fault.values['node']} {stage}")
        topic.tell(listener.stamp, [one])

    return ProcessFaults(children, schedule, tell)


def _watch(
    children: Processes,
    listener: StatusListener,
    progress: Progress,
    stop: Interrupts,
    faults: ProcessFaults,
) -> None:
    """Show the progress until the plant ends or the user stops it. Raises NodeFailed."""
    noted, restarts = -NOTE_PERIOD, RestartTopic(listener.node)
    changed = ChangedParameters(listener.node)
    while children.running(wiring.PLANT) and not stop.raised:
        if time.monotonic() - noted >= NOTE_PERIOD:  # who is killed cannot be asked any more
            children.note_shared_memory()
            noted = time.monotonic()
        changed.poll()
        for lost in children.revive(changed.arguments):
            text = f"{lost}; started again"
            progress.message(text)
            restarts.tell(listener.stamp, lost.name, text)
        children.check()
        for failure in children.missed():
            progress.message(f"{failure}; the flight goes on without it")
        status = listener.poll()
        faults.update(listener.mission_time)
        if status is not None:
            progress.update(status)
        time.sleep(POLL)
    progress.finish()
    if not stop.raised:
        children.check()


def _outcome(
    settings: FlightSettings,
    folder: ResultFolder,
    failure: NodeFailed | None,
    interrupted: bool,
) -> Outcome:
    outcome = Outcome(series=None, interrupted=interrupted)
    if failure is not None and not interrupted:
        outcome.failure, outcome.details = str(failure), failure.last_lines
    numbers = _statistics(folder.path / "logs" / "mujoco_sim.json")
    outcome.wall_s = numbers.get("wall_s", 0.0)
    if settings.clock == "realtime":
        outcome.latency_s = numbers.get("latency_s", [])
        outcome.missed_ticks = numbers.get("missed_ticks")
        late, asked = numbers.get("late_ticks", 0), numbers.get("answerable_ticks", 0)
        if late:
            outcome.notes.append(
                f"{late} of {asked} setpoints came later than one control period after their sample"
            )
    recorder = _statistics(folder.path / "logs" / "recorder.json")
    if lost := recorder.get("lost"):
        text = ", ".join(f"{count} of {topic}" for topic, count in lost.items())
        outcome.notes.append(f"the recorder lost messages: {text}")
    try:
        flight = read_flight(folder.log, settings.scenario)
    except (UnreadableLog, OSError) as error:
        outcome.failure = outcome.failure or f"nothing recorded: {error}"
        return outcome
    outcome.series, outcome.abort_reason = flight.series, flight.abort_reason
    outcome.parameter_changes, outcome.transitions = flight.parameter_changes, flight.transitions
    outcome.faults = flight.faults
    if not flight.done and not outcome.partial:
        ended = recorder.get("ended") or numbers.get("ended_by")
        outcome.failure = ended or "the mission did not end"
    return outcome


def _statistics(file: Path) -> dict[str, Any]:
    """What a node reported at its end; {} when it did not get to it."""
    try:
        return json.loads(file.read_text())
    except (OSError, ValueError):
        return {}
