"""`uam vehicle`: bring a real vehicle up and fly it.

Start the drivers and the nodes of a real vehicle, as its lab file describes it.

examples:
  uam vehicle --example > my_lab.yaml        the template of a lab file, with comments
  uam vehicle --config my_lab.yaml           drivers, estimator, mission, controllers, bridge ...
  uam vehicle --config my_lab.yaml --dry-run        all commands computed, none sent, nothing armed
  uam vehicle import drone.urdf              the files of a vehicle of yours: uam vehicle import -h
  uam vehicle --config my_lab.yaml --systemd | sudo tee /etc/systemd/system/uam-vehicle.service
  uam vehicle design my/quad.yaml            gains and profile of a vehicle of yours

It names each device that is missing and how to check it, waits, and uses a device that is plugged
in later. Nothing arms by itself: uam start in another shell, or the cockpit's button. Ctrl-C on the
ground ends all nodes and keeps the log; in the air it commands a landing, a second one ends the
nodes at once, and the autopilot's failsafe acts. docs/first_flight.md, docs/hardware.md. Exit
status: 0 mission or dry run completed, 1 flown but not completed, 2 wrong use, 130 ended by Ctrl-C.
"""

import argparse
import dataclasses
import getpass
import shlex
import sys
from functools import partial
from pathlib import Path

from uam_control.settings import configuration
from uam_lab.cli import vehicle_design, vehicle_import
from uam_lab.cli.command import Command, path
from uam_lab.cli.fly import fly, missed_margins
from uam_lab.flights.conclude import command_line
from uam_lab.flights.node_options import SettingsError
from uam_lab.flights.vehicle.lab_file import load_lab, settings_of, template
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import say

UNIT = "systemd/uam-vehicle.service"


def add(command: Command) -> None:
    command.config()
    command.switch("--dry-run", "compute all commands for the present pose; send none, arm nothing")
    text = "result folder (default <out of the lab file>/<time>-<scenario>)"
    command.option("--out", "DIR", text, type=path)
    command.switch("--no-report", "leave out the report; uam report makes it later")
    command.switch("--example", "print the template of a lab file, and end")
    command.switch("--systemd", "print the unit that starts this at boot, and end")
    command.subcommands(**{"import": vehicle_import, "design": vehicle_design})


def run(options: argparse.Namespace) -> int:
    if options.example:
        say(template(), end="")
        return 0
    if options.config is None:
        raise SettingsError("--config LAB is missing; uam vehicle --example prints a template")
    lab = load_lab(options.config)
    if options.systemd:
        say(unit(lab.file, Path.cwd()), end="")
        return 0
    from uam_lab.flights.vehicle import vehicle_engine  # needs ROS

    settings = settings_of(lab, command_line(), options.dry_run)
    missed = missed_margins(settings)
    if missed and not options.dry_run:
        raise SettingsError(f"{missed[0]}: uam vehicle design, or another profile in the lab file")
    out = options.out or make_folder(None, settings.scenario.name, parent=lab.out.expanduser())
    settings = dataclasses.replace(settings, out=out, notes=settings.notes + missed)
    engine = partial(vehicle_engine.fly, lab)
    return fly(settings, video=False, report=options.report, engine=engine, name="vehicle")


def unit(lab: Path, folder: Path) -> str:
    """Return the systemd unit that runs `uam vehicle` with this lab file in `folder`."""
    command = f"{Path(sys.argv[0]).absolute()} vehicle --config {shlex.quote(str(lab.absolute()))}"
    return (
        configuration.path(UNIT)
        .read_text(encoding="utf-8")
        .replace("@USER@", getpass.getuser())
        .replace("@FOLDER@", str(folder))
        .replace("@COMMAND@", command)
    )
