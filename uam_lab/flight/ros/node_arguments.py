"""Parameters of all nodes of a flight: from the profile and from the settings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from uam_control.mission.time_limit import time_limit
from uam_lab.cockpit import place
from uam_lab.flight.conclude import command_line, settings_facts
from uam_lab.flight.ros.nodes import in_the_loop, users_autopilot
from uam_lab.flight.settings import BUILTIN, FlightSettings
from uam_lab.recording import log_facts
from uam_lab.results.result_folder import ResultFolder, as_json, versions
from uam_msgs_py.node import wiring
from uam_sim_bridge.faults import LINK, PLANT
from uam_sim_bridge.ports import Ports

FACTS = "facts.json"
# nodes that load the description of the vehicle
DESCRIBED = {
    *(wiring.ESTIMATOR, wiring.MISSION, wiring.POSITION, wiring.ATTITUDE, wiring.ARM),
    *(wiring.PLANT, wiring.BRIDGE, wiring.SCENE, wiring.COCKPIT),
}
PX4_LINGER = 4.0  # [s] simulated, after the mission, in which PX4 disarms and closes its log
START_TIMEOUT = 20.0  # [s] without progress until every node is connected to the others
OWN_START_TIMEOUT = 600.0  # [s] the same if the user starts a node by hand
ANSWER_TIMEOUT = 10.0  # [s] for the answers to one lockstep tick


def parameters(
    settings: FlightSettings, folder: ResultFolder, ports: Ports
) -> dict[str, dict[str, Any]]:
    """Return the parameters of each node, from the profile and from the settings."""
    sections = {node: values.to_mapping() for node, values in settings.profile.sets.items()}
    sections[wiring.MISSION]["scenario"] = scenario_source(settings)
    sections[wiring.PLANT] = {
        "vehicle_changes": json.dumps(settings.vehicle_changes),
        "plant": settings.plant,
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
        # system id: as PX4 SITL numbers its instances; 1 for a flight controller
        "autopilot_system": 1.0 if in_the_loop(settings) else float(ports.instance + 1),
        "gcs": settings.gcs,
        "faults": settings.faults.only(LINK).to_text(),
    }
    if users_autopilot(settings):
        sections[wiring.BRIDGE]["autopilot"] = settings.autopilot
    sections[wiring.SCENE] = {"scenario": scenario_source(settings)}
    if wiring.COCKPIT not in settings.without:
        sections[wiring.COCKPIT] = {"port": place.free_port(place.LOCAL, place.PORT)}
    sections[wiring.RECORDER] = {
        "file": str(folder.log),
        "statistics": str(folder.path / "logs" / "recorder.json"),
        "facts": str(folder.path / "logs" / FACTS),
        "size_limit": settings.log_limit,
    }
    for node in DESCRIBED & sections.keys():
        sections[node]["vehicle"] = settings.vehicle.source
    return sections


def write_facts(settings: FlightSettings, folder: ResultFolder) -> None:
    """Write the facts for the log's metadata: settings, scenario, parameters, versions."""
    texts = {
        folder.parameters.name: folder.parameters.read_text(),
        folder.versions.name: as_json(versions()),
    }
    known = settings_facts(settings, command_line())
    log_facts.write(folder.path / "logs" / FACTS, known, scenario_source(settings), texts)


def scenario_source(settings: FlightSettings) -> str:
    """Return the scenario for the mission node: a name, or the absolute path of a file."""
    given = Path(settings.scenario_source)
    return str(given.absolute()) if given.suffix else settings.scenario_source
