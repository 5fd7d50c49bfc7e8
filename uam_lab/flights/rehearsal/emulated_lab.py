"""The lab file of a rehearsal: the given one, with the names of its devices replaced."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from uam_control.settings import configuration, yaml_file
from uam_lab.flights.vehicle.lab import GPIO, Lab, LabError
from uam_lab.flights.vehicle.lab_file import load_lab
from uam_lab.records.results.atomic import write_text
from uam_sim_bridge.devices.mocap.calibration import FOLDER as CALIBRATIONS
from uam_sim_bridge.devices.mocap.mocap_parameters import NATNET
from uam_sim_bridge.laboratory.laboratory import BUS_DEVICE, SERIAL_NEAR
from uam_sim_bridge.mavlink.transport.transport import parse_url

HOST = "127.0.0.1"
MAGNET_LINE = "magnet"  # file of the simulated line, in the folder of the devices
SIMULATED = "simulated:"
NAME = "lab.yaml"
BAUD = 921600  # of the line, where the lab file has another kind of link


def baud_of(lab: Lab) -> int:
    """Return the baud rate of the autopilot's line."""
    link = parse_url(lab.autopilot)
    return link.number if link.kind == "serial" else BAUD


def emulated(lab: Lab, devices: Path, mocap_port: int) -> dict[str, Any]:
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


def write(document: dict[str, Any], given: Path, folder: Path) -> Lab:
    """Write the rehearsed lab file into `folder` and read it; given: the file it is made of."""
    file = folder / NAME
    head = f"# Rehearsal of {given}: the same file with the names of emulated devices.\n"
    write_text(file, head + yaml.safe_dump(document, sort_keys=False, allow_unicode=True))
    return load_lab(file)
