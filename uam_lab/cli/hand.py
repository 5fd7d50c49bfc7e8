"""`uam hand`: where the end effector of a vehicle is."""

from __future__ import annotations

import argparse
import json
import math
from typing import Any

import numpy as np

from uam_control.arm.kinematics import DOWN, hand_pose, vehicle_centre
from uam_control.maths.rotations import quaternion_from_matrix
from uam_control.vehicle import VehicleDescription, VehicleError, chain_of, load_description
from uam_lab.cli.command import Command, Subcommands
from uam_lab.flights.node_options import SettingsError
from uam_lab.records.results.terminal import say

ACTIONS = ("fk",)
EXAMPLES = """\
examples:
  uam hand fk --joints 0.5,1.0                               angles in radians
  uam hand fk --joints=-45,-45 --degrees --json              in degrees; for a program

The base is level; an end effector on a passive hinge hangs. position_m and orientation_wxyz: of
the end effector; centre_of_mass_m: of the whole vehicle without payload. All from the origin of the
base frame, FLU (x forward, y left, z up). Angles beyond a joint's range are computed, and told.
"""


def add(commands: Subcommands) -> None:
    """Add the subcommand to the command line."""
    command = Command(
        commands,
        "hand",
        run,
        "where the end effector is",
        "Print where the end effector of a vehicle is: fk, forward kinematics.",
        EXAMPLES,
    )
    command.option("action", None, f"one of {', '.join(ACTIONS)}", choices=ACTIONS)
    command.vehicle()
    text = "angle of each joint, base to tip, in radians, with commas and no space between them"
    command.option("--joints", "A,B,...", text, type=angles, required=True)
    command.switch("--degrees", "the angles are in degrees")
    command.switch("--json", "print JSON, for programs")


def angles(text: str) -> list[float]:
    """Return the numbers in `text`, a type for argparse."""
    try:
        found = [float(word) for word in text.split(",")]
    except ValueError:
        found = [math.nan]
    if not all(map(math.isfinite, found)):
        raise argparse.ArgumentTypeError(f"'{text}' is no list of angles, as 0.5,1.0")
    return found


def run(options: argparse.Namespace) -> int:
    """Print the answer; return the exit status."""
    vehicle = load_description(options.vehicle)
    q = np.array(options.joints)
    if len(q) != len(vehicle.joints):
        raise SettingsError(
            f"--joints: {len(q)} angles, {vehicle.name} has {len(vehicle.joints)} joints: "
            f"{', '.join(vehicle.joint_names)}"
        )
    found = forward(vehicle, np.radians(q) if options.degrees else q)
    if options.json:
        say(json.dumps(found, indent=1))
        return 0
    for name, value in found.items():
        numbers = isinstance(value, list) and value and isinstance(value[0], float)
        say(f"{name:<18} {' '.join(f'{one:.6f}' for one in value) if numbers else value}")
    return 0


def forward(vehicle: VehicleDescription, q: np.ndarray) -> dict[str, Any]:
    """Return what `fk` prints, for joint angles (n,) [rad]. Raises VehicleError without a hand."""
    chain = chain_of(vehicle)
    if not chain.has_hand:
        raise VehicleError(
            f"{vehicle.file}: no end effector: name a site of {vehicle.model.name}, as "
            "end_effector: SITE"
        )
    position, rotation = hand_pose(chain, q, DOWN)
    limits = zip(vehicle.joints, q, strict=True)
    return {
        "vehicle": vehicle.name,
        "joints_rad": q.tolist(),
        "position_m": list(position),
        "orientation_wxyz": quaternion_from_matrix(np.array(rotation)).tolist(),
        "centre_of_mass_m": list(vehicle_centre(chain, q, DOWN)),
        "beyond_range": [one.name for one, angle in limits if not one.low <= angle <= one.high],
    }
