"""`uam hand`: where the end effector is, and can be.

Compute forward and inverse kinematics and the workspace of a vehicle's end effector.

examples:
  uam hand fk --joints 0.5,1.0                             forward kinematics, angles in radians
  uam hand fk --joints=-45,-45 --degrees --json            in degrees; for a program
  uam hand ik --position 0.15 0 -0.25                      angles for a place in the base frame [m]
  uam hand workspace --out reach.png                       where it can be, as a picture

The base is level; an end effector on a passive hinge hangs. position_m and orientation_wxyz: of
the end effector; centre_of_mass_m: of the whole vehicle without payload. All from the origin of the
base frame, FLU (x forward, y left, z up). fk computes angles beyond a joint's range, too, and tells
it; ik stays within. Exit status 1: ik: the arm does not reach the place; the nearest is printed.
"""

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.kinematics import DOWN, hand_pose, vehicle_centre
from uam_control.maths.rotations import quaternion_from_matrix
from uam_control.vehicle import VehicleDescription, VehicleError, chain_of, load_description
from uam_lab.cli.command import Command, number, path, refuse_given
from uam_lab.flights.node_options import SettingsError
from uam_lab.records.results.terminal import say

DONE, BEYOND = 0, 1
NEAR = 1e-6  # [m] at which a place is reached
LARGEST = 1e4  # angle of a joint, as given
POSTURES = 20000  # of the workspace
# option → its action, and whether that needs it
OF = {
    "joints": ("fk", True),
    "degrees": ("fk", False),
    "position": ("ik", True),
    "out": ("workspace", False),
}


def add(command: Command) -> None:
    choices = tuple(ACTIONS)
    command.option("action", None, f"one of {', '.join(choices)}", choices=choices)
    command.vehicle()
    text = "fk: angle of each joint, base to tip, in radians, with commas and no space between them"
    command.option("--joints", "A,B,...", text, type=angles)
    command.switch("--degrees", "the angles of --joints are in degrees")
    place = number("place", "m", -100.0, 100.0)
    text = "ik: place of the end effector in the base frame [m]"
    command.option("--position", ("X", "Y", "Z"), text, type=place, nargs=3)
    command.option("--out", "FILE", "workspace: picture, PNG", type=path)
    command.switch("--json", "print JSON, for programs")


def angles(text: str) -> list[float]:
    """Return the numbers in `text`, a type for argparse."""
    try:
        found = [float(word) for word in text.split(",")]
    except ValueError:
        found = [math.nan]
    if not all(abs(one) <= LARGEST for one in found):
        raise argparse.ArgumentTypeError(
            f"'{text}' is no list of angles, as 0.5,1.0, at most {LARGEST:g}"
        )
    return found


def run(options: argparse.Namespace) -> int:
    for name, (action, needed) in OF.items():
        given = getattr(options, name)
        if action != options.action:
            refuse_given(f"is of {action}", **{name: given})
        elif needed and given is None:
            raise SettingsError(f"{action} needs --{name}")
    _check_picture(options.out)
    vehicle = load_description(options.vehicle)
    chain = chain_of(vehicle)
    if not chain.has_hand:
        raise VehicleError(
            f"{vehicle.file}: no end effector: name a site of {vehicle.model.name}, as "
            "end_effector: SITE"
        )
    found = {"vehicle": vehicle.name} | ACTIONS[options.action](vehicle, chain, options)
    if options.json:
        say(json.dumps(found, indent=1))
    else:
        for name, value in found.items():
            numbers = isinstance(value, list) and value and isinstance(value[0], float)
            say(f"{name:<18} {' '.join(f'{one:.6f}' for one in value) if numbers else value}")
    return BEYOND if found.get("distance_m", 0.0) > NEAR else DONE


def _check_picture(file: Path | None) -> None:
    """Raise SettingsError for a file that no PNG can be written to."""
    if file is None:
        return
    if file.suffix.lower() != ".png" or file.is_dir():
        raise SettingsError(f"--out {file}: a file whose name ends in .png is needed")
    if not file.parent.is_dir():
        raise SettingsError(f"--out {file}: there is no folder {file.parent}")


def _fk(vehicle: VehicleDescription, chain: Chain, options: argparse.Namespace) -> dict[str, Any]:
    q = np.array(options.joints)
    if len(q) != len(vehicle.joints):
        raise SettingsError(
            f"--joints: {len(q)} angles, {vehicle.name} has {len(vehicle.joints)} joints: "
            f"{', '.join(vehicle.joint_names)}"
        )
    return _posture(vehicle, chain, np.radians(q) if options.degrees else q)


def _ik(vehicle: VehicleDescription, chain: Chain, options: argparse.Namespace) -> dict[str, Any]:
    from uam_control.arm.hand import angles_for

    q, distance = angles_for(chain, np.array(options.position), *_ranges(vehicle))
    return _posture(vehicle, chain, q) | {"distance_m": distance}


def _workspace(
    vehicle: VehicleDescription, chain: Chain, options: argparse.Namespace
) -> dict[str, Any]:
    from uam_control.arm.hand import reached
    from uam_lab.report.figures.hand_figures import draw_workspace

    places = reached(chain, *_ranges(vehicle), POSTURES)
    found = {"lowest_m": places.min(axis=0).tolist(), "highest_m": places.max(axis=0).tolist()}
    if options.out is not None:
        draw_workspace(options.out, vehicle.name, places)
        found["picture"] = str(options.out)
    return found


ACTIONS = {"fk": _fk, "ik": _ik, "workspace": _workspace}


def _ranges(vehicle: VehicleDescription) -> np.ndarray:
    """Return lowest and highest angles (2, n) [rad] of the joints."""
    return np.array([(one.low, one.high) for one in vehicle.joints]).T


def _posture(vehicle: VehicleDescription, chain: Chain, q: np.ndarray) -> dict[str, Any]:
    """Return what is told about joint angles (n,) [rad]."""
    position, rotation = hand_pose(chain, q, DOWN)
    limits = zip(vehicle.joints, q, strict=True)
    return {
        "joints_rad": q.tolist(),
        "position_m": list(position),
        "orientation_wxyz": quaternion_from_matrix(np.array(rotation)).tolist(),
        "centre_of_mass_m": list(vehicle_centre(chain, q, DOWN)),
        "beyond_range": [one.name for one, angle in limits if not one.low <= angle <= one.high],
    }
