"""`uam rehearse`: fly a lab file on emulated devices.

Fly a lab file with the vehicle's nodes: serial lines, sockets and GPIO are emulated.

examples:
  uam rehearse --config my_lab.yaml                  as uam vehicle, on emulated devices
  uam rehearse --scenario pick_and_place             the template's laboratory
  uam rehearse --cable bus_unplugged@carry+2         pull the arm's adapter, 2 s into the carry
  uam rehearse --cable serial_bit_errors@start --no-report
  uam rehearse --px4-dir ~/PX4-Autopilot/build/px4_sitl_nolockstep     a real PX4 in HITL
  uam rehearse --cable joints_swapped@start          a mistake of the wiring: the start is refused
  uam faults --list                                  all faults; those of cables at the end

The same nodes, drivers and lab file as uam vehicle; only the names of the devices are replaced
(lab.yaml in the result folder). Faults: docs/preflight.md.
Exit status: 0 mission completed, 1 not completed or refused, 2 wrong use.
"""

import argparse
import os
from dataclasses import replace
from functools import partial
from pathlib import Path

from uam_control.offboard.autopilot_magnet import GRIPPER
from uam_lab.cli.command import Command, chosen_effects, number
from uam_lab.cli.fly import fly
from uam_lab.flights.conclude import command_line
from uam_lab.flights.flight_settings import require_ros
from uam_lab.flights.vehicle.lab_file import TEMPLATE, load_lab, settings_of
from uam_lab.records.results.result_folder import known_json, make_folder
from uam_sim_bridge.faults import CABLE, FaultError, read_schedule
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.px4 import px4_parameters
from uam_sim_bridge.px4.px4_installation import LOOP_VARIABLE, Px4Error, Px4Installation


def add(command: Command) -> None:
    command.config(TEMPLATE)
    command.option("--scenario", "NAME|FILE", "in place of the lab file's")
    command.repeated(
        "--cable",
        "SPEC|FILE",
        "a fault of a cable or the wiring: NAME@PHASE[+AFTER[+DURATION]], NAME@SECONDS[+DURATION] "
        "or NAME@start, then :parameter=value,...; uam faults --list shows all",
        dest="cables",
    )
    command.option(
        "--px4-dir",
        "DIR",
        "PX4 build without lockstep, which flies in HITL (default: $PX4_HITL_DIR, else the "
        "stand-in flies)",
    )
    command.repeated(
        "--px4-param",
        "NAME=VALUE",
        "a parameter of that PX4, in place of config/'s",
        dest="px4_params",
    )
    command.plant()
    mass = number("mass", "kg", 0.0)
    command.option("--payload-mass", "KG", "default: the scenario's", type=mass)
    command.seed("of all noise")
    command.out("<scenario>-rehearsal")
    command.switch("--no-video", "leave out the video, which takes longest")
    command.switch("--no-report", "leave out the report with its video; uam report makes it later")


def px4_of(directory: str | None, given: list[str]) -> Px4Installation | None:
    """Return the PX4 that flies, None for the stand-in; given: its parameters. Raises Px4Error."""
    if directory is None and not os.environ.get(LOOP_VARIABLE):
        if given:
            raise Px4Error("--px4-param needs --px4-dir: the stand-in has no parameter of PX4")
        return None
    found = Px4Installation.find(directory, LOOP_VARIABLE)
    px4_parameters.parse(given, found.ranges())
    return found


def run(options: argparse.Namespace) -> int:
    require_ros()
    from uam_lab.flights.rehearsal import device_figures, engine

    lab = load_lab(options.config)
    if options.scenario:
        lab = replace(lab, scenario=options.scenario)
    settings = settings_of(lab, command_line())
    mass = settings.payload_mass if options.payload_mass is None else options.payload_mass
    cables = read_schedule(options.cables, settings.scenario, options.seed)
    for one in cables.faults:
        if one.fault.PLACE != CABLE:
            raise FaultError(f"{one.fault.NAME}: not of a cable: uam fly --fault")
    px4 = px4_of(options.px4_dir, options.px4_params)
    if px4 is not None and lab.magnet.output.magnet == GRIPPER:
        px4.require_gripper()
    effects = presets.added({}, chosen_effects(options))
    settings = replace(
        settings,
        seed=options.seed,
        payload_mass=mass,
        out=options.out or make_folder(None, settings.scenario.name, "rehearsal"),
        vehicle_changes=effects,
        faults=cables,
        px4=px4,
        px4_params=tuple(options.px4_params),
    )

    def further(folder: Path) -> list[str]:
        return device_figures.lines(known_json(folder / device_figures.NAME))

    flown_by = partial(engine.fly, lab)
    return fly(settings, options.video, options.report, flown_by, "rehearse", further)
