"""Parameters of the laboratory's process, arguments of the autopilot's, the rehearsed lab file.

That file is the given one, with the names of its devices replaced.

The autopilot is the stand-in, or a PX4 in HITL with both of its lines as pseudo-terminals.
"""

import json
from pathlib import Path
from typing import Any

import yaml

from uam_control.mission.time_limit import time_limit
from uam_control.offboard.autopilot_magnet import GRIPPER
from uam_control.settings import configuration, yaml_file
from uam_control.settings.atomic import write_text
from uam_control.settings.configuration import ConfigurationError
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.ros.node_arguments import AUTOPILOT_WAIT, PX4_LOG, STAND_IN
from uam_lab.flights.vehicle.lab_file import GPIO, Lab, LabError, load_lab
from uam_lab.records.recording.logged_topics import LABORATORY_FILE
from uam_sim_bridge.devices.mocap.calibration import FOLDER as CALIBRATIONS
from uam_sim_bridge.faults import CABLE
from uam_sim_bridge.laboratory.laboratory import BUS_DEVICE, SERIAL_FAR, SERIAL_NEAR, USB
from uam_sim_bridge.laboratory.laboratory_parameters import LINE, NATNET, TCP, TOPIC
from uam_sim_bridge.mavlink.transport.transport import parse_url
from uam_sim_bridge.ports import Ports
from uam_sim_bridge.px4 import px4_parameters
from uam_sim_bridge.px4.hitl import gripper_parameter
from uam_sim_bridge.px4.px4_installation import Px4Installation

LABORATORY, LABORATORY_MODULE = "laboratory", "uam_sim_bridge.nodes.laboratory"
PX4 = "uam_sim_bridge.px4.hitl"
PARAMETERS = "px4/rehearsed.yaml"  # of config/: as a real vehicle needs them
REQUIRED, IN_THE_LOOP = "px4/vehicle.yaml", "px4_parameters.yaml"  # in config/, in the logs
GRIPPER_ON, GRIPPER_OFF = 1.0, -1.0  # outputs of a closed and an open gripper
HOST = "127.0.0.1"
MAGNET_LINE = "magnet"  # file of the simulated line, in the folder of the devices
SIMULATED = "simulated:"
NAME = "lab.yaml"
BAUD = 921600  # of the line, where the lab file has another kind of link


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
        # [s] after arming: with faults it may never land; 0, never: a person may fly by goals
        "flight_limit": time_limit(settings.scenario, None) if settings.faults else 0.0,
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
    write_text(file, yaml.safe_dump(sections, sort_keys=False))
    return {"required_parameters": str(file.absolute())}


def baud_of(lab: Lab) -> int:
    """Return the baud rate of the autopilot's line."""
    link = parse_url(lab.autopilot)
    return link.number if link.kind == "serial" else BAUD


def emulated_lab(lab: Lab, devices: Path, mocap_port: int) -> dict[str, Any]:
    """Return the content of the rehearsed lab file.

    devices: folder of the pseudo-terminals; mocap_port: command port of the emulated server.
    Raises LabError where a device cannot be emulated.
    """
    document = dict(yaml_file.read(lab.file, LabError))
    arm = document["arm"]
    if isinstance(arm, str):
        arm = yaml_file.read(lab.arm_file, LabError)["arm"]
    document |= {  # names of files are relative to the lab file: write them in full
        "vehicle": lab.vehicle.source,
        "profile": list(lab.profile),
        "scenario": lab.scenario,
        "arm": {**arm, "device": str(devices / BUS_DEVICE)},
        "autopilot": f"serial:{devices / SERIAL_NEAR}:{baud_of(lab)}",
        "autopilot_system": 1,
    }
    if not lab.profile:
        del document["profile"]
    if lab.mocap is not None:
        if lab.mocap.source != NATNET:
            raise LabError(
                f"{lab.file}: mocap: source: {lab.mocap.source}: only {NATNET} can be rehearsed"
            )
        found = configuration.named(CALIBRATIONS, lab.mocap.calibration)
        document["mocap"] = {
            **document["mocap"],
            "server": HOST,
            "local": "",
            "command_port": mocap_port,
            "calibration": str(found.absolute()),
        }
    if lab.magnet.through == GPIO:
        line = f"{SIMULATED}{devices / MAGNET_LINE}"
        document["magnet"] = {**document["magnet"], "chip": line}
    return document


def write_lab(document: dict[str, Any], given: Path, folder: Path) -> Lab:
    """Write the rehearsed lab file into `folder` and read it; given: the file it is made of."""
    file = folder / NAME
    head = f"# Rehearsal of {given}: the same file with the names of emulated devices.\n"
    write_text(file, head + yaml.safe_dump(document, sort_keys=False, allow_unicode=True))
    return load_lab(file)
