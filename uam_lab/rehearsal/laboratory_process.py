"""Parameters of the laboratory's process, and arguments of the autopilot's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from uam_control.settings import configuration
from uam_lab.rehearsal.emulated_lab import MAGNET_LINE, baud_of
from uam_lab.rehearsal.options import RehearsalOptions
from uam_lab.vehicle.lab import Lab
from uam_sim_bridge.faults import CABLE
from uam_sim_bridge.ports import Ports
from uam_sim_bridge.rehearsal.laboratory import SERIAL_FAR

LABORATORY, LABORATORY_MODULE = "laboratory", "uam_sim_bridge.nodes.laboratory"
AUTOPILOT, STAND_IN = "autopilot", "uam_sim_bridge.autopilot.server"
STATISTICS = "laboratory.json"
PARAMETERS = "px4/rehearsed.yaml"  # of config/: as a real vehicle needs them
AUTOPILOT_WAIT = 60.0  # [s] for which the autopilot waits for the simulator


def parameters(
    lab: Lab, options: RehearsalOptions, devices: Path, logs: Path, ports: Ports
) -> dict[str, Any]:
    """Return the parameters of the laboratory; lab: as rehearsed; devices, logs: folders."""
    found = {
        "vehicle": lab.vehicle.source,
        "vehicle_changes": json.dumps(dict(options.vehicle_changes)),
        "payload_mass": float(options.payload_mass),
        "seed": options.seed,
        "arm_start": list(options.arm_start),
        "folder": str(devices),
        "hardware": str(lab.arm_file),
        "baud": baud_of(lab),
        "magnet": lab.magnet.through,
        "magnet_line": str(devices / MAGNET_LINE),
        "active_low": lab.magnet.line.active_low,
        "magnet_output": lab.magnet.output.magnet_output,
        "imu": lab.imu,
        "hil_port": ports.simulator_tcp,
        "faults": options.faults.only(CABLE).to_text(),
        "person": options.checklist,
        "time_limit": options.time_limit,
        "statistics": str(logs / STATISTICS),
    }
    if lab.mocap is not None:
        found |= {
            "mocap_port": lab.mocap.command_port,
            "body": lab.mocap.body,
            "payload": lab.mocap.payload,
            "calibration": lab.mocap.calibration,
        }
    return found


def autopilot(lab: Lab, devices: Path, ports: Ports) -> tuple[str, list[str]]:
    """Return module and arguments of the autopilot; its companion is at the cable's far end."""
    line = f"{devices / SERIAL_FAR}:{baud_of(lab)}"
    place = ["--sim-port", str(ports.simulator_tcp), "--companion", line]
    parameters = str(configuration.path(PARAMETERS))
    vehicle = ["--vehicle", lab.vehicle.source, "--params", parameters]
    return STAND_IN, [*place, *vehicle, "--wait", str(AUTOPILOT_WAIT), "--once"]
