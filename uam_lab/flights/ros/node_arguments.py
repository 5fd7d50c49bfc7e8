"""The processes of a flight with the ROS engine: modules, parameters, autopilot's arguments."""

import json
from pathlib import Path
from typing import Any

import yaml

from uam_control.mission.time_limit import time_limit
from uam_control.profiles.profile import servo_mode
from uam_control.settings.atomic import write_text
from uam_control.vehicle import VehicleDescription, load_description
from uam_lab import executables
from uam_lab.cockpit import page_address
from uam_lab.flights.conclude import settings_facts
from uam_lab.flights.flight_options import AUTOPILOT_IMU, BUILTIN
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.node_options import EVERY_NODE
from uam_lab.records.recording import log_facts
from uam_lab.records.results.result_folder import PX4_LOG, ResultFolder, as_json, versions
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_sim_bridge.faults import LINK, PLANT
from uam_sim_bridge.paced_clock import LATEST
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay
from uam_sim_bridge.ports import INSTANCES, Ports
from uam_sim_bridge.px4 import px4_parameters

# Executable → module. Started and, at the end, stopped in this order, the recorder last.
MODULES = {
    name: executables.MODULES[name]
    for name in (
        wiring.RECORDER,
        wiring.PLANT,
        wiring.ESTIMATOR,
        wiring.MISSION,
        wiring.POSITION,
        wiring.ATTITUDE,
        wiring.ARM,
        wiring.BRIDGE,
        wiring.SCENE,
        wiring.COCKPIT,
    )
}
FUSED = executables.MODULES[wiring.FLIGHT_CONTROLLER]
WHOLE_BODY = executables.MODULES[wiring.WHOLE_BODY]
# process of several nodes → its module, its nodes
HOSTS = {
    wiring.FLIGHT_CONTROLLER: (FUSED, wiring.FUSED),
    wiring.WHOLE_BODY: (WHOLE_BODY, wiring.CONTROLLERS),
}
STAND_IN, SITL = "uam_sim_bridge.autopilot.server", "uam_sim_bridge.px4.sitl"
HITL_ROUTER = "uam_sim_bridge.mavlink.hil.router"
AUTOPILOT_WAIT = 60.0  # [s] for which the autopilot waits for the simulator
FACTS = "facts.json"
REQUIRED = "px4_parameters.yaml"
GAINS = "autopilot_gains.yaml"
TICK_TIMES = "tick_times"  # folder of logs/
RECORDER_PRIORITY = 1  # where nodes have a real-time priority: the recorder may not starve
FLYING = set(wiring.FUSED)  # nodes of the control tick
MEASURED = FLYING | {wiring.PLANT, wiring.FLIGHT_CONTROLLER}  # nodes that can measure their ticks
# nodes that load the description of the vehicle
DESCRIBED = {
    *FLYING,
    *(wiring.PLANT, wiring.SCENE, wiring.COCKPIT),
}
PX4_LINGER = 4.0  # [s] simulated, after the mission, in which PX4 disarms and closes its log
DRY_RUN = 20.0  # [s] simulated, length of a dry run
START_TIMEOUT = 60.0  # [s] without progress until every node is connected; a busy machine is slow
OWN_START_TIMEOUT = 600.0  # [s] the same if the user starts a node by hand
ANSWER_TIMEOUT = 0.0  # no limit of wall time for the answers to one lockstep tick


def parameters(
    settings: FlightSettings, folder: ResultFolder, ports: Ports
) -> dict[str, dict[str, Any]]:
    """Return the parameters of each node, from the profile and from the settings."""
    sections = flight_nodes(settings, folder)
    sections[wiring.MISSION]["autopilot_has_clock"] = in_the_loop(settings)
    sections[wiring.PLANT] = {
        "vehicle_changes": json.dumps(
            settings.vehicle_changes | servo_mode(settings.profile) | settings.scenario.surroundings
        ),
        "plant": settings.plant,
        "payload_mass": float(settings.payload_mass),
        "seed": settings.seed,
        "arm_start": list(settings.scenario.arm_start),
        "clock": settings.clock,
        "publish_imu": settings.imu != AUTOPILOT_IMU,
        "hil_port": ports.simulator_tcp,
        "hil_address": settings.sim_address,
        "autopilot_always_answers": settings.autopilot == BUILTIN,
        # an autopilot with its own clock must not see a long time that passes faster
        "let_go": LATEST if in_the_loop(settings) else 0.0,
        "linger": 0.0 if settings.autopilot == BUILTIN else PX4_LINGER,
        "recorded": True,
        "end_with_mission": True,
        "start_timeout": OWN_START_TIMEOUT if settings.foreign else START_TIMEOUT,
        "foreign": ",".join(
            f"{name}={settings.own_names.get(name, name)}" for name in settings.foreign
        ),
        "faults": settings.faults.only(PLANT).to_text(),
        "answer_timeout": ANSWER_TIMEOUT,
        "time_limit": _time_limit(settings),
        "statistics": str(folder.path / "logs" / "mujoco_sim.json"),
    }
    delay = SetpointDelay.of(settings.vehicle_changes.get("effects", {}), settings.seed)
    sections[wiring.BRIDGE] |= {
        "local_port": ports.offboard_udp,
        "autopilot_port": ports.autopilot_udp,
        # system id: as PX4 SITL numbers its instances; 1 for a flight controller
        "autopilot_system": 1 if in_the_loop(settings) else ports.instance + 1,
        "faults": settings.faults.only(LINK).to_text(),
        "network_delay": "" if delay is None else delay.to_text(),
        "imu_clock": "topic",
    }
    if users_autopilot(settings):
        sections[wiring.BRIDGE]["autopilot"] = settings.autopilot
    if settings.autopilot != BUILTIN:
        sections[wiring.BRIDGE] |= _px4_parameters(settings, folder)
    sections[wiring.SCENE] = {
        "scenario": scenario_source(settings),
        **settings.scenario_options.to_mapping(),
    }
    if wiring.COCKPIT not in settings.without:
        # ports of its own: two flights that start at once never choose the same
        first = page_address.PORT + ports.instance
        sections[wiring.COCKPIT] = {
            "port": page_address.free_port(page_address.LOCAL, first, INSTANCES),
            "results": str(folder.path.absolute()),
        }
    return complete(sections, settings, folder)


def flight_nodes(settings: FlightSettings, folder: ResultFolder) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes that fly in simulation and on a vehicle alike.

    Those of their links and displays are missing.
    """
    sections = {node: values.to_mapping() for node, values in settings.profile.sets.items()}
    sections[wiring.MISSION] |= {
        "scenario": scenario_source(settings),
        **settings.scenario_options.to_mapping(),
        "auto_start": settings.auto_start,
        "dry_run": settings.dry_run,
    }
    sections[wiring.BRIDGE] = settings.profile.bridge() | {
        "clock": settings.clock,
        "gcs": settings.gcs,
        "dry_run": settings.dry_run,
        "imu_source": settings.imu,
    }
    for node in (wiring.ESTIMATOR, wiring.MISSION, wiring.BRIDGE):
        sections[node]["pose_source"] = settings.pose_source
    sections[wiring.RECORDER] = {
        "file": str(folder.log),
        "statistics": str(folder.path / "logs" / "recorder.json"),
        "facts": str(folder.path / "logs" / FACTS),
        "size_limit": settings.log_limit,
    }
    return sections


def complete(
    sections: dict[str, dict[str, Any]], settings: FlightSettings, folder: ResultFolder
) -> dict[str, dict[str, Any]]:
    """Return the sections with parameters of nodes without a profile, of vehicle and processes."""
    if settings.fused:
        sections[wiring.FLIGHT_CONTROLLER] = {
            "without": ",".join(name for name in wiring.FUSED if name in settings.without)
        }
    for node, values in settings.parameters.items():
        if node in sections:
            sections[node] |= values
    for node in DESCRIBED & sections.keys():
        sections[node]["vehicle"] = settings.vehicle.source
    # in the fused layout they are those of its process
    processes = {wiring.FLIGHT_CONTROLLER} if settings.fused else FLYING
    for node in processes & sections.keys():
        sections[node] |= settings.process.changes()
    realtime = settings.clock == "realtime"  # in lockstep the plant waits for the recorder
    if settings.process.fifo_priority and realtime and wiring.RECORDER in sections:
        sections[wiring.RECORDER]["fifo_priority"] = RECORDER_PRIORITY
    if settings.tick_times:
        place = folder.path / "logs" / TICK_TIMES
        place.mkdir(exist_ok=True)
        for node in MEASURED & sections.keys():
            sections[node]["tick_times"] = str((place / f"{node}.npz").absolute())
    return sections


def _px4_parameters(settings: FlightSettings, folder: ResultFolder) -> dict[str, Any]:
    """Write the list of the parameters that PX4 must have; return the bridge's parameters.

    The bridge compares them. It writes only those of a PX4 that the flight starts.
    """
    own = settings.px4
    values = px4_parameters.load(
        settings.vehicle, None, settings.px4_params, None if own is None else own.ranges()
    )
    file = folder.path / "logs" / REQUIRED
    write_text(file, px4_parameters.required(values, in_the_loop(settings)))
    return {"required_parameters": str(file.absolute()), "set_parameters": own is not None}


def write(
    sections: dict[str, dict[str, Any]], settings: FlightSettings, folder: ResultFolder
) -> None:
    """Write the parameters of the nodes, and the facts for the log's metadata: settings, scenario,
    parameters, versions."""
    folder.write_parameters(sections)
    texts = {
        folder.parameters.name: folder.parameters.read_text(encoding="utf-8"),
        folder.versions.name: as_json(versions()),
    }
    known = settings_facts(settings)
    log_facts.write(folder.path / "logs" / FACTS, known, scenario_source(settings), texts)


def scenario_source(settings: FlightSettings) -> str:
    """Return the scenario for the mission node: a name, or the absolute path of a file."""
    given = Path(settings.scenario_source)
    return str(given.absolute()) if given.suffix else settings.scenario_source


def modules(settings: FlightSettings) -> dict[str, str]:
    """Return the processes of a flight: executable → module."""
    found = {name: module for name, module in MODULES.items() if name not in settings.without}
    return arranged(found, settings.fused, settings.profile.whole)


def arranged(modules: dict[str, str], fused: bool, whole: bool) -> dict[str, str]:
    """Return the processes of the nodes `modules`; fused: the control nodes are one process; whole:
    the controllers are, of a law of the whole body."""
    host = wiring.FLIGHT_CONTROLLER if fused else wiring.WHOLE_BODY if whole else ""
    if not host:
        return modules
    one, inside = HOSTS[host]
    return {
        host if name in inside else name: one if name in inside else module
        for name, module in modules.items()
    }


def nodes_in(process: str, settings: FlightSettings) -> tuple[str, ...]:
    """Return the nodes of a process that `modules` names."""
    if process not in HOSTS:
        return (process,)
    return tuple(name for name in HOSTS[process][1] if name not in settings.without)


def fused_line(settings: FlightSettings) -> str:
    """Return the line for the user about the fused layout."""
    process = wiring.FLIGHT_CONTROLLER
    return f"fused: {', '.join(nodes_in(process, settings))} in the process {process}"


def process_remappings(settings: FlightSettings, process: str) -> list[str]:
    """Return the ROS arguments with the remappings of a process; those of its nodes come first."""
    if process not in HOSTS:
        return remappings(settings, process)
    own = [
        word
        for node in (process, *nodes_in(process, settings))
        for old, new in settings.remappings.get(node, {}).items()
        for word in ("-r", f"{node}:{old}:={new}")
    ]
    return own + common_remappings(settings)


def remappings(settings: FlightSettings, node: str) -> list[str]:
    """Return the ROS arguments with the remappings of a node; those of its own come first."""
    own = settings.remappings.get(node, {})
    every = settings.remappings.get(EVERY_NODE, {})
    names = own | {old: new for old, new in every.items() if old not in own}
    return [word for old, new in names.items() for word in ("-r", f"{old}:={new}")]


def common_remappings(settings: FlightSettings) -> list[str]:
    return remappings(settings, EVERY_NODE)


def publishers(settings: FlightSettings) -> str:
    """Return the parameter `publishers` of every node: the simulator's topics are its own."""
    pairs = {wiring.PLANT: wiring.PLANT} | settings.own_names
    if settings.imu == AUTOPILOT_IMU:
        pairs[topics.IMU.name] = wiring.BRIDGE
    return ",".join(f"{node}={name}" for node, name in pairs.items())


def _time_limit(settings: FlightSettings) -> float:
    """Return the simulated time [s] after which the plant ends; 0: none, an operator starts."""
    if settings.dry_run:
        return DRY_RUN
    if not settings.auto_start:
        return 0.0
    return time_limit(settings.scenario, settings.profile.sets["mission"])


def in_the_loop(settings: FlightSettings) -> bool:
    """Return whether a flight controller is connected by one serial line (hardware in the loop)."""
    return settings.link is not None and settings.link.kind == "serial"


def users_autopilot(settings: FlightSettings) -> bool:
    """Return whether the user starts the autopilot, which itself connects to the plant."""
    return settings.link is not None and not in_the_loop(settings)


def autopilot(
    settings: FlightSettings, folder: ResultFolder, ports: Ports
) -> tuple[str, list[str]]:
    """Return module and arguments of the autopilot's process; "" if the user starts it."""
    instance = ["--instance", str(ports.instance)]
    patience = ["--wait", str(AUTOPILOT_WAIT)]
    vehicle = ["--vehicle", settings.vehicle.source]
    if in_the_loop(settings):
        return HITL_ROUTER, [settings.autopilot, *instance, *patience]
    changed = changed_gains(settings.vehicle)
    if settings.px4 is not None:
        log = folder.path / PX4_LOG
        own = ["--px4-dir", str(settings.px4.directory), "--log", str(log.absolute())]
        own += ["--once"]
        given = [f"{name}={value:g}" for name, value in changed.items()]
        own += [word for text in (*given, *settings.px4_params) for word in ("--param", text)]
        return SITL, [*instance, *own, *vehicle]
    if users_autopilot(settings):
        return "", []
    if changed:
        file = folder.path / "logs" / GAINS
        write_text(file, yaml.safe_dump(changed))
        vehicle += ["--params", str(file.absolute())]
    return STAND_IN, [*instance, *patience, *vehicle, "--once"]


def changed_gains(vehicle: VehicleDescription) -> dict[str, float]:
    """Return the gains of the autopilot that differ from those of the vehicle's file."""
    written = load_description(vehicle.source).autopilot_gains
    return {k: v for k, v in vehicle.autopilot_gains.items() if written.get(k) != v}
