"""Parameters of the laboratory's process, and arguments of the autopilot's.

The autopilot is the stand-in, or a PX4 in HITL with both of its lines as pseudo-terminals.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml

from uam_control.mission.time_limit import time_limit
from uam_control.offboard.autopilot_magnet import GRIPPER
from uam_control.settings import configuration, yaml_file
from uam_control.settings.configuration import ConfigurationError
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.rehearsal.emulated_lab import MAGNET_LINE, baud_of
from uam_lab.flights.ros.node_arguments import AUTOPILOT_WAIT, PX4_LOG, STAND_IN
from uam_lab.flights.vehicle.lab import Lab
from uam_lab.records.recording.node_statistics import LABORATORY_FILE
from uam_sim_bridge.faults import CABLE
from uam_sim_bridge.laboratory.laboratory import SERIAL_FAR, USB
from uam_sim_bridge.nodes.laboratory_options import LINE, NATNET, TCP, TOPIC
from uam_sim_bridge.ports import Ports
from uam_sim_bridge.px4 import px4_parameters
from uam_sim_bridge.px4.hitl import gripper_parameter
from uam_sim_bridge.px4.px4_installation import Px4Installation

LABORATORY, LABORATORY_MODULE = "laboratory", "uam_sim_bridge.nodes.laboratory"
PX4 = "uam_sim_bridge.px4.hitl"
PARAMETERS = "px4/rehearsed.yaml"  # of config/: as a real vehicle needs them
REQUIRED, IN_THE_LOOP = "px4/vehicle.yaml", "px4_parameters.yaml"  # in config/, in the logs
GRIPPER_ON, GRIPPER_OFF = 1.0, -1.0  # outputs of a closed and an open gripper


def parameters(
    lab: Lab, settings: FlightSettings, devices: Path, logs: Path, ports: Ports, person: bool = True
) -> dict[str, Any]:
    """Return the parameters of the laboratory; lab: as rehearsed; devices, logs: folders.

    person: whether the lists are required and a person does them.
    """
    changes = dict(settings.vehicle_changes) | settings.scenario.surroundings
    found = {
        "vehicle": lab.vehicle.source,
        "vehicle_changes": json.dumps(changes),
        "payload_mass": float(settings.payload_mass),
        "seed": settings.seed,
        "arm_start": list(settings.scenario.arm_start),
        "folder": str(devices),
        "hardware": str(lab.arm_file),
        "baud": baud_of(lab),
        "magnet": lab.magnet.through,
        "magnet_line": str(devices / MAGNET_LINE),
        "active_low": lab.magnet.line.active_low,
        **_magnet_output(lab),
        "imu": lab.imu,
        "hil_port": ports.simulator_tcp,
        "hil": TCP if settings.px4 is None else LINE,
        "faults": settings.faults.only(CABLE).to_text(),
        "person": person,
        "flight_limit": _flight_limit(settings),
        "statistics": str(logs / LABORATORY_FILE),
    }
    found["poses"] = TOPIC if lab.mocap is None else NATNET
    if lab.mocap is None:
        found["mocap_port"] = 0  # nobody connects
    else:
        found |= {
            "mocap_port": lab.mocap.command_port,
            "body": lab.mocap.body,
            "payload": lab.mocap.payload,
            "calibration": lab.mocap.calibration,
        }
    return found


def _flight_limit(settings: FlightSettings) -> float:
    """Return the time [s] after arming that ends a flight with faults, which may never land.

    0, never, without faults: a person may fly by goals.
    """
    return time_limit(settings.scenario, None) if settings.faults else 0.0


def _magnet_output(lab: Lab) -> dict[str, Any]:
    """Return the parameters of the autopilot's output with the magnet."""
    output = lab.magnet.output
    on, off = output.magnet_on, output.magnet_off
    if output.magnet == GRIPPER:
        on, off = GRIPPER_ON, GRIPPER_OFF
    return {"magnet_output": output.magnet_output, "magnet_on": on, "magnet_off": off}


def autopilot(
    lab: Lab, settings: FlightSettings, devices: Path, folder: Path, ports: Ports
) -> tuple[str, list[str]]:
    """Return module and arguments of the autopilot; its companion is at the cable's far end.

    devices: folder of the pseudo-terminals; folder: of the results.
    """
    line = f"{devices / SERIAL_FAR}:{baud_of(lab)}"
    parameters = str(configuration.path(PARAMETERS))
    vehicle = ["--vehicle", lab.vehicle.source, "--companion", line]
    if settings.px4 is None:
        place = ["--sim-port", str(ports.simulator_tcp), "--wait", str(AUTOPILOT_WAIT)]
        place += ["--once", "--prefer"]
        return STAND_IN, [*vehicle, "--params", parameters, *place]
    log = folder / PX4_LOG
    own = ["--px4-dir", str(settings.px4.directory), "--log", str(log.absolute())]
    own += ["--usb", str(devices / USB), "--instance", str(ports.instance)]
    simulation = str(configuration.path(px4_parameters.SIMULATION))
    given = list(settings.px4_params)
    if lab.magnet.output.magnet == GRIPPER:
        given.insert(0, gripper_parameter(lab.magnet.output.magnet_output))
    own += [word for text in given for word in ("--param", text)]
    return PX4, [*vehicle, *own, "--params", simulation, parameters]


def required_parameters(px4: Px4Installation | None, logs: Path) -> dict[str, Any]:
    """Return the bridge's parameter of what the autopilot must have: a vehicle's list.

    A PX4 in the loop has SYS_HITL 1, and nothing else otherwise. Raises ConfigurationError.
    """
    if px4 is None:
        return {}
    sections = yaml_file.read(configuration.path(REQUIRED), ConfigurationError)
    sections["needed"]["SYS_HITL"] = {"is": 1, "why": "in the loop, in a rehearsal"}
    file = logs / IN_THE_LOOP
    file.write_text(yaml.safe_dump(sections, sort_keys=False), encoding="utf-8")
    return {"required_parameters": str(file.absolute())}
