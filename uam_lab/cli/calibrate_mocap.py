"""`uam calibrate-mocap`: axes of the motion capture system and pivot of the vehicle's body.

Measure how a motion capture system's axes and rigid body lie to the world (ENU) and the vehicle
(FLU), guided, from two places on the floor.

examples:
  uam calibrate-mocap --config my_lab.yaml --out my_lab_mocap.yaml
  uam calibrate-mocap --server 192.168.1.5 --body uam        without a lab file
  uam calibrate-mocap --server 192.168.1.5 --up z            Motive set to Z up
  uam calibrate-mocap --server 192.168.1.5 --pivot 0.03 0    pivot 3 cm in front of base_link
  uam calibrate-mocap --server 192.168.1.7 --source motioncapture --system vicon --up z
  uam calibrate-mocap --server 192.168.1.5 --save raw.csv    keep the measured poses
  uam calibrate-mocap --log raw.csv                          from recorded poses

The command asks for two places: level on the floor, then again after a straight move nose first.
It refuses measurements without sense (moved, tilted, turned, too short a way) and writes the file
that the section `mocap` of the lab file names as its calibration. docs/hardware.md. Exit
status: 0 written, 2 refused.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from uam_control.settings.atomic import write_text
from uam_control.vehicle import DEFAULT_VEHICLE, VehicleDescription, load_description
from uam_lab.cli.command import Command, number, path
from uam_lab.flights.vehicle.lab_file import LabError, lab_mocap, lab_path, lab_vehicle, read_lab
from uam_lab.records.results.terminal import say
from uam_sim_bridge.devices.mocap.mocap_parameters import (
    LIBRARY,
    NATNET,
    SYSTEMS,
    MocapParameters,
    open_source,
)

if TYPE_CHECKING:
    from uam_sim_bridge.devices.mocap.calibration import Calibration
    from uam_sim_bridge.devices.mocap.measurement import TimedPose

LEVEL, AHEAD = "first place", "second place"
STEPS = {
    LEVEL: "1. Put the vehicle level on the floor, with at least 0.5 m free in front of its nose.",
    AHEAD: "2. Push it straight ahead, nose first, by 0.5 m or more; 1 m is better.",
}
DEFAULTS = MocapParameters()


def add(command: Command) -> None:
    command.config()
    for flag, metavar, name, text, how in (
        ("--server", "HOST", "server", "computer of the system", {}),
        ("--body", "NAME", "body", "rigid body of the vehicle", {}),
        ("--source", None, "source", "as of mocap_driver", {"choices": (NATNET, LIBRARY)}),
        ("--system", None, "system", f"with --source {LIBRARY}", {"choices": SYSTEMS}),
        ("--port", "N", "command_port", "command port of Motive", {"type": int}),
        ("--local", "ADDRESS", "local", "own address in its network", {}),
    ):
        shown = getattr(DEFAULTS, name) or "as routed"
        text = f"{text} (default: the lab file's, {shown} without)"
        command.option(flag, metavar or "|".join(how["choices"]), text, dest=name, **how)
    command.choice("--up", ("y", "z"), "y", "the system's axis that points up")
    text = "angle about up, from the system's axes to the world's"
    command.option("--heading", "DEG", text, 0.0, type=number("heading", "deg", -360.0, 360.0))
    text = "pivot of the rigid body from base_link, forward and left"
    place = number("distance", "m", -0.5, 0.5)
    command.option("--pivot", ("X", "Y"), text, [0.0, 0.0], type=place, nargs=2)
    command.vehicle("the lab file's")
    text = "base_link above the floor (default: from the vehicle's model)"
    command.option("--height", "M", text, type=number("height", "m", 0.0, 2.0))
    text = "duration of a measurement"
    command.option("--duration", "S", text, 3.0, type=number("duration", "s", 1.0, 60.0))
    command.option("--log", "CSV", "recorded poses instead of the running system", type=path)
    command.option("--save", "CSV", "write the measured poses", type=path)
    command.option("--out", "FILE", "", Path("mocap_calibration.yaml"), type=path)


def run(options: argparse.Namespace) -> int:
    from uam_sim_bridge.devices.mocap import calibration, measurement
    from uam_sim_bridge.devices.mocap.calibration import fit

    standing = options.height if options.height is not None else _standing(_vehicle(options))
    found = _recorded(options) if options.log else _measured(options)
    level, ahead = (measurement.still(poses, what) for what, poses in found.items())
    heading = math.radians(options.heading)
    made = fit(level, ahead, options.up, heading, standing, options.pivot)
    write_text(options.out, calibration.text(made))
    _say(made, options)
    return 0


def _vehicle(options: argparse.Namespace) -> VehicleDescription:
    """Return the vehicle of --vehicle, of the lab file, or the default one."""
    if options.vehicle is None and options.config:
        return lab_vehicle(read_lab(lab_path(options.config)))
    return load_description(options.vehicle or DEFAULT_VEHICLE)


def _standing(vehicle: VehicleDescription) -> float:
    """Return the height [m] of base_link above the floor; raises VehicleError."""
    from uam_sim_bridge.plant import Vehicle
    from uam_sim_bridge.plant.frames import standing_height

    return standing_height(Vehicle.of(vehicle).compile(0.0))


def _recorded(options: argparse.Namespace) -> dict[str, list[TimedPose]]:
    """Return the first and the last place of a recording at which the vehicle stands still."""
    from uam_sim_bridge.devices.mocap import measurement
    from uam_sim_bridge.devices.mocap.frame import MocapError
    from uam_sim_bridge.devices.mocap.measurement import places

    found = places(measurement.read_poses(options.log), min(1.0, options.duration))
    if len(found) < 2:
        raise MocapError(
            f"{options.log}: {len(found)} places where the vehicle stands still, 2 are needed"
        )
    return {LEVEL: list(found[0]), AHEAD: list(found[-1])}


def _parameters(options: argparse.Namespace) -> MocapParameters:
    """Return those of the lab file, or the defaults, with the given options in their place."""
    known: MocapParameters | None = DEFAULTS
    if options.config:
        known = lab_mocap(read_lab(lab_path(options.config)))
        if known is None:
            raise LabError(f"{options.config}: mocap: topic: the poses are another driver's")
    names = ("source", "system", "server", "command_port", "local", "body")
    given = {name: getattr(options, name) for name in names}
    changes = {name: value for name, value in given.items() if value is not None}
    return MocapParameters.from_mapping(known.to_mapping() | changes)


def _measured(options: argparse.Namespace) -> dict[str, list[TimedPose]]:
    from uam_sim_bridge.devices.mocap import measurement

    parameters = _parameters(options)
    body = parameters.body
    source = open_source(parameters)
    found: dict[str, list[TimedPose]] = {}
    try:
        measurement.until_known(source, body)
        say(f"measures '{body}' of {source.description}")
        for what, step in STEPS.items():
            _confirm(step)
            found[what] = measurement.tracked_poses(source, body, options.duration)
            place = measurement.still(found[what], what)
            say(
                f"   {place.count} poses, spread {1e3 * place.spread:.2f} mm, "
                f"{math.degrees(place.wobble):.2f} deg"
            )
    finally:
        source.close()
        if options.save and found:
            measurement.write_poses(
                options.save, [pose for poses in found.values() for pose in poses]
            )
    return found


def _confirm(step: str) -> None:
    from uam_sim_bridge.devices.mocap.frame import MocapError

    try:
        input(f"{step}\n   Take your hands off, then press Enter. ")
    except EOFError:
        raise MocapError("a person must confirm each step; or use --log") from None


def _say(made: Calibration, options: argparse.Namespace) -> None:
    m = made.measured
    say(
        f"moved {m['distance_m']:.2f} m; between the places: {m['height_difference_m']:+.4f} m "
        f"higher, tilted {m['tilt_difference_deg']:.2f} deg, turned "
        f"{m['heading_difference_deg']:+.2f} deg"
    )
    say(
        f"rigid body tilted {m['body_tilt_deg']:.1f} deg against the vehicle; pivot "
        f"{made.pivot[2]:+.3f} m above base_link"
    )
    say(f"written  {options.out}")
    say(f"use it   in the lab file: mocap: {{calibration: {options.out}}}")
