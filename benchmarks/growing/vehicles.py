"""Vehicles with more joints or rotors than those of config/vehicle, derived from them.

The arm has the length and, but for the servos' bodies, the mass of the S-500's; the rotors have the
thrust of the hexacopter's in all. These vehicles hover with the profiles of the originals.
"""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import Any

import mujoco
import yaml

from uam_control.settings import configuration

ARM_LENGTH, LINKS_MASS = 0.24, 0.10  # [m] to the magnet's pivot, [kg]
SERVO_MASS = 0.082  # [kg] of each servo beyond the first, which is fixed to the frame
RADIUS, HEIGHT = 0.275, 0.05  # [m] of the rotors
JOINT = {"range_deg": [-100, 100], "stowed_deg": 0}
TWO = ("alpha_1", "alpha_2")  # joints of the original
STOWED = 90  # [deg] of the second joint


def with_joints(count: int, folder: Path) -> str:
    """Return --vehicle of an S-500 with so many joints; new files go to `folder`."""
    if count in (2, 3):
        return {2: "s500_arm", 3: "s500_arm3"}[count]
    name = f"s500_arm{count}"
    _with_parts(folder)
    (folder / "parts" / f"arm_{count}r.xml").write_text(_arm(count))
    model = configuration.path("vehicle/s500_arm.xml").read_text()
    (folder / f"{name}.xml").write_text(model.replace("arm_2r", f"arm_{count}r"))
    values = _read("vehicle/s500_arm.yaml")
    joints = [{"name": f"alpha_{k}", **JOINT} for k in range(1, count + 1)]
    joints[1]["stowed_deg"] = STOWED
    values |= {"model": f"{name}.xml", "joints": joints, "mass": _mass(folder / f"{name}.xml")}
    profile = _read("profiles/s500.yaml")
    own = profile["arm_controller"]["ros__parameters"]
    for key, value in own.items():
        if isinstance(value, list) and len(value) == len(TWO):
            own[key] = [*value, *[value[-1]] * (count - len(value))]
    values["profiles"] = {"modular": _write(folder / f"{name}_profile.yaml", profile)}
    return _write(folder / f"{name}.yaml", values)


def with_rotors(count: int, folder: Path) -> str:
    """Return --vehicle of an airframe with so many rotors; new files go to `folder`."""
    if count in (4, 6):
        return {4: "s500_arm", 6: "hexa_arm"}[count]
    name = f"multi{count}_arm"
    _with_parts(folder)
    model = configuration.path("vehicle/hexa_arm.xml").read_text()
    (folder / f"{name}.xml").write_text(model)
    values = _read("vehicle/hexa_arm.yaml")
    rotors = values["rotors"]
    share = len(rotors["layout"]) / count
    rotors["layout"] = [_rotor(k, count) for k in range(count)]
    rotors["thrust_coefficient"] = float(rotors["thrust_coefficient"]) * share
    rotors["efficiency"] = [1.0] * count
    values["model"] = f"{name}.xml"
    return _write(folder / f"{name}.yaml", values)


def _rotor(number: int, count: int) -> dict[str, Any]:
    angle = 2.0 * math.pi * (number + 0.5) / count
    place = [round(RADIUS * math.cos(angle), 6), round(RADIUS * math.sin(angle), 6), HEIGHT]
    direction = "ccw" if number % 2 else "cw"
    return {"name": f"rotor_{number + 1}", "position": place, "direction": direction}


def _arm(count: int) -> str:
    """Return the MJCF of an arm whose links all have the same length."""
    length = ARM_LENGTH / count
    servo = SERVO_MASS * (count > 1) / (count - 1)
    lines = [
        '<body name="shoulder" pos="0 0 -0.073">',
        '<geom name="servo_1" type="box" size="0.0143 0.017 0.0233" mass="0.091"/></body>',
    ]
    for k in range(1, count + 1):
        above = 0.073 if k == 1 else length
        lines += [
            f'<body name="link_{k}" pos="0 0 -{above}"><joint name="alpha_{k}" class="arm_link"/>',
            f'<geom name="link_{k}" class="arm_link" type="capsule" '
            f'fromto="0 0 -0.005 0 0 -{length - 0.01:.4f}" size="0.009" '
            f'mass="{LINKS_MASS / count:.5f}" material="link"/>',
        ]
        if k < count:
            lines.append(
                f'<geom name="servo_{k + 1}" class="arm_link" type="box" '
                f'size="0.0143 0.012 0.01" pos="0 0 -{length}" mass="{servo:.5f}"/>'
            )
    lines.append(f'<body name="magnet" pos="0 0 -{length}"><include file="parts/magnet.xml"/>')
    return "<mujocoinclude>\n" + "\n".join(lines) + "</body>" * (count + 1) + "\n</mujocoinclude>\n"


def _with_parts(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copytree(configuration.path("vehicle/parts"), folder / "parts", dirs_exist_ok=True)


def _mass(model: Path) -> float:
    """Return the mass [kg] of the vehicle in a model, without the payload."""
    loaded = mujoco.MjModel.from_xml_path(str(model))
    return round(float(loaded.body_subtreemass[loaded.body("base").id]), 6)


def _read(name: str) -> dict[str, Any]:
    return yaml.safe_load(configuration.path(name).read_text())


def _write(file: Path, values: dict[str, Any]) -> str:
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    return str(file.absolute())
