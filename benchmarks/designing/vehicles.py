"""Vehicles from 0.6 to 8 kg, made by similarity from the numbers of config/vehicle/.

Body and arm are as long, and their inertias as large, as those of an S-500 of that radius; servos
and drag grow with the arm and the mass.
"""

from __future__ import annotations

import math
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import yaml

from uam_control.settings import configuration
from uam_sim_bridge.plant.effects.presets import Effects

MAGNET = 0.07  # [kg] of parts/magnet.xml
INERTIA = 0.16, 0.18, 0.24  # of the body, parts of mass radius^2
SHOULDER, SHORT, FOOT = 0.3, 0.03, 0.012  # of the radius to joint 1, magnet below its pivot, foot
STRONG = 4.0  # stall torque, parts of the torque that holds the arm level
THRUST_TO_WEIGHT = 2.0
PAYLOAD = 0.05  # of the mass
AXES = {"x": "1 0 0", "y": "0 -1 0", "z": "0 0 1"}  # of a roll, pitch and yaw joint
PICK = "pick"
SCENARIO_NAMES = ("hover", "circle", "arm motions", PICK)
S500 = 2.2, 0.242, 3.0  # mass [kg], radius [m], stall torque [N m] for which effects have numbers
# exponents of mass, radius and torque by which an effect's number grows; a rotor of mass radius^3
# that is balanced to the same grade, imbalance times speed, has an imbalance of radius^4
GROWS = {
    ("mass_mismatch", "shift"): (0, 1, 0),
    ("standing_load", "force"): (1, 0, 0),
    ("standing_load", "torque"): (1, 1, 0),
    ("propeller_vibration", "imbalance"): (0, 4, 0),
    ("battery_sag", "capacity"): (1, 0, 0),
    ("battery_sag", "resistance"): (-1, 0, 0),
    ("battery_sag", "electronics"): (1, 0, 0),
    ("servo_noise", "torque"): (0, 0, 1),
    ("cable_torque", "stiffness"): (0, 0, 1),
}
STAND, GRIP, SET_DOWN = 0.789, 0.767, 0.10  # [m] of config/environment.yaml; face above the mat


@dataclass(frozen=True)
class Made:
    """A vehicle: mass [kg]; places of rotors, or pairs of coaxial ones; radius [m]; lag of the
    rotors [s]; joints of the arm; arm: its share of the mass without the magnet; axes: of the
    joints, by AXES, "" for all about y."""

    name: str
    mass: float
    places: int
    radius: float
    lag: float
    joints: int
    coaxial: bool = False
    arm: float = 0.09
    thrust_to_weight: float = THRUST_TO_WEIGHT
    axes: str = ""


VEHICLES = (
    Made("quad_0600", 0.6, 4, 0.12, 0.015, 1, arm=0.06),
    Made("quad_1000", 1.0, 4, 0.16, 0.020, 2),
    Made("hexa_1500", 1.5, 6, 0.20, 0.030, 3),
    Made("quad_2000", 2.0, 4, 0.24, 0.050, 2, thrust_to_weight=1.8),
    Made("x8_2500", 2.5, 4, 0.24, 0.025, 1, coaxial=True),
    Made("hexa_3000", 3.0, 6, 0.30, 0.060, 4, axes="zyyz"),
    Made("quad_3750", 3.75, 4, 0.325, 0.100, 4, thrust_to_weight=2.4),
    Made("octo_4500", 4.5, 8, 0.40, 0.040, 5, axes="xyyzy"),
    Made("x8_5000", 5.0, 4, 0.35, 0.080, 3, coaxial=True),
    Made("hexa_6000", 6.0, 6, 0.45, 0.070, 5, arm=0.12),
    Made("octo_7000", 7.0, 8, 0.50, 0.100, 2),
    Made("octo_8000", 8.0, 8, 0.55, 0.060, 4, arm=0.12, thrust_to_weight=1.7),
)


def write(made: Made, folder: Path) -> Path:
    """Write MJCF and YAML of a vehicle without profile and autopilot; return the YAML file."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copytree(configuration.path("vehicle/parts"), folder / "parts", dirs_exist_ok=True)
    model, file = folder / f"{made.name}.xml", folder / f"{made.name}.yaml"
    model.write_text(_model(made))
    loaded = mujoco.MjModel.from_xml_path(str(model))
    mass = float(loaded.body_subtreemass[loaded.body("base").id])
    file.write_text(yaml.safe_dump(_numbers(made, round(mass, 6)), sort_keys=False))
    return file


def scenarios(made: Made, folder: Path) -> dict[str, Path]:
    """Write what a vehicle flies: hover, a circle at 1 m/s, motions of each joint, a pick."""
    ground = [
        {"coordinate": name, "from": 0, "until": 3, "to": height}
        for name, height in (("x", 0.0), ("y", 0.0), ("z", 1.2))
    ]
    phases = [{"from": 0, "name": "take-off"}, {"from": 3, "name": "motion"}]
    hover = {
        "phases": phases,
        "moves": ground,
        "landing": {"at": 9, "duration": 6},
    }
    circle = {"kind": "circle", "radius": 1.0, "speed": 1.0, "laps": 2, "height": 1.2}
    moves, time = list(ground), 4.0
    for k in range(1, made.joints + 1):
        home = _stowed(made)[k - 1]
        for angle in (home - 40.0 if home else 40.0, home):
            name = f"alpha_{k}"
            moves.append({"coordinate": name, "from": time, "until": time + 2.5, "to_deg": angle})
            time += 3.0
    arm = {"phases": phases, "moves": moves, "landing": {"at": time, "duration": 6}}
    found, flown = {}, (hover, {"trajectory": circle}, arm, _pick(made))
    for name, values in zip(SCENARIO_NAMES, flown, strict=True):
        found[name] = folder / f"{made.name}_{name.replace(' ', '_')}.yaml"
        found[name].write_text(yaml.safe_dump({"description": f"{name}."} | values))
    return found


def grown(made: Made, effects: Effects) -> Effects:
    """Return effects whose numbers are those of an S-500 for the vehicle, by similarity."""
    sizes = made.mass, made.radius, _stall(made)
    ratios = [one / of for one, of in zip(sizes, S500, strict=True)]
    found = {name: dict(values) for name, values in effects.items()}
    for (name, parameter), powers in GROWS.items():
        if name in found:
            factor = math.prod(one**power for one, power in zip(ratios, powers, strict=True))
            value = found[name][parameter]
            many = isinstance(value, list)
            found[name][parameter] = [factor * one for one in value] if many else factor * value
    return found


def _pick(made: Made) -> dict[str, Any]:
    """Return a pick with the arm straight down, which reaches below the feet."""
    reach = round((SHOULDER + 1.0) * made.radius + SHORT, 4)
    high = GRIP + reach + 0.25
    moves = [
        {"coordinate": name, "from": begin, "until": end, "to": to}
        for name, begin, end, to in (
            *(("x", 0, 3, 0.0), ("y", 0, 3, 0.0), ("z", 0, 3, high)),
            *(("x", 3, 7, -STAND), ("z", 8, 11, GRIP + reach - 0.004), ("z", 12, 14, high)),
            *(("x", 14, 19, STAND), ("z", 19, 23, SET_DOWN + reach), ("z", 24, 28, high)),
            ("x", 28, 32, 0.0),
        )
    ]
    for k, home in enumerate(_stowed(made), start=1):
        for begin, to in (3, 0.0), (28, home):
            name = f"alpha_{k}"
            moves.append({"coordinate": name, "from": begin, "until": begin + 4, "to_deg": to})
    return {
        "phases": [{"from": 0, "name": "take-off"}, {"from": 3, "name": "motion"}],
        "moves": moves,
        "magnet": [{"at": 11.5, "energised": True}, {"at": 23.5, "energised": False}],
        "payload": {"mass": PAYLOAD * made.mass, "drop_point": [STAND, 0.0]},
        "landing": {"at": 33, "duration": 6},
    }


def _stowed(made: Made) -> list[float]:
    return [90.0] if made.joints == 1 else [0.0, 90.0, *[0.0] * (made.joints - 2)]


def _numbers(made: Made, mass: float) -> dict[str, Any]:
    values = yaml.safe_load(configuration.path("vehicle/s500_arm.yaml").read_text())
    del values["profiles"], values["autopilot"]
    size, layout = made.radius / 0.242, _layout(made)
    propeller, rotors = round(0.127 * size, 4), values["rotors"]
    speed = 1100.0 * 0.127 / propeller
    thrust = made.thrust_to_weight * mass * 9.81 / len(layout)
    rotors |= {
        "layout": layout,
        "radius": propeller,
        "speed_max": round(speed, 1),
        "thrust_coefficient": thrust / round(speed, 1) ** 2,
        "moment_ratio": round(0.016 * size, 5),
        "lag_up": made.lag,
        "lag_down": made.lag,
        "efficiency": [1.0] * len(layout),
    }
    stall = round(_stall(made), 3)
    values["servos"] |= {
        "stall_torque": stall,
        "effort_limit": round(0.93 * stall, 3),
        "torque_per_current": round(1.304 * stall / 3.0, 4),
    }
    values["air"] |= {
        "drag": [round(one * (mass / 2.2) ** (2 / 3), 3) for one in (0.15, 0.15, 0.2)]
    }
    joints = [
        {"name": f"alpha_{k + 1}", "range_deg": [-110, 110], "stowed_deg": stowed}
        for k, stowed in enumerate(_stowed(made))
    ]
    return values | {"model": f"{made.name}.xml", "mass": mass, "joints": joints}


def _layout(made: Made) -> list[dict[str, Any]]:
    rotors = []
    for k in range(made.places):
        angle = 2.0 * math.pi * (k + 0.5) / made.places
        x, y = (round(made.radius * one(angle), 5) for one in (math.cos, math.sin))
        for level in (0, 1) if made.coaxial else (0,):
            turn = "ccw" if (k + level) % 2 else "cw"
            place = [x, y, round((0.2 - 0.3 * level) * made.radius, 5)]
            rotors.append(
                {"name": f"rotor_{len(rotors) + 1}", "position": place, "direction": turn}
            )
    return rotors


def _link(made: Made) -> float:
    """Return the length of a link [m]; the arm is as long as the radius."""
    return round(made.radius / made.joints, 4)


def _stall(made: Made) -> float:
    """Return the stall torque [N m] of the servos."""
    level = made.arm * made.mass * 0.5 * made.radius + MAGNET * (made.radius + SHORT)
    return STRONG * 9.81 * level


def _model(made: Made) -> str:
    link, base = _link(made), made.mass * (1.0 - made.arm) - MAGNET
    stands = SHOULDER * made.radius + (link if made.joints > 1 else 0.0) + SHORT + 0.05
    inertia = " ".join(f"{part * base * made.radius**2:.6g}" for part in INERTIA)
    feet = "".join(
        f'<geom name="foot_{2 * i + j + 1}" class="foot" '
        f'pos="{x * 0.5 * made.radius:.4f} {y * 0.6 * made.radius:.4f} -{stands:.4f}"/>'
        for i, x in enumerate((1, -1))
        for j, y in enumerate((1, -1))
    )
    strength = _stall(made) / 3.0
    about = (
        f'class="arm_link" armature="{0.01 * strength:.6g}" '
        f'frictionloss="{0.08 * strength:.6g}" damping="{0.02 * strength:.6g}"'
    )
    arm = []
    for k in range(1, made.joints + 1):
        above = round(SHOULDER * made.radius, 5) if k == 1 else link
        axis = AXES[made.axes[k - 1]] if made.axes else AXES["y"]
        arm.append(
            f'<body name="link_{k}" pos="0 0 -{above}">'
            f'<joint name="alpha_{k}" axis="{axis}" {about}/>'
            f'<geom class="arm_link" type="capsule" fromto="0 0 -{0.1 * link:.4f} 0 0 '
            f'-{0.9 * link:.4f}" size="{0.08 * link:.5f}" '
            f'mass="{made.arm * made.mass / made.joints:.6g}"/>'
        )
    arm.append(f'<body name="magnet" pos="0 0 -{link}"><include file="parts/magnet.xml"/></body>')
    return (
        f'<mujoco model="{made.name}"><include file="parts/world.xml"/><worldbody>'
        f'<body name="base" pos="0 0 {stands + FOOT + 0.005:.4f}"><freejoint name="base"/>'
        f'<inertial pos="0 0 0" mass="{base:.6g}" diaginertia="{inertia}"/>'
        '<site name="imu" pos="0 0 0" size="0.005"/>'
        f'<geom type="box" size="{0.3 * made.radius:.4f} {0.2 * made.radius:.4f} 0.012" mass="0" '
        f'material="carbon"/>{feet}{"".join(arm)}{"</body>" * made.joints}</body>'
        '</worldbody><include file="parts/sensors.xml"/></mujoco>'
    )
