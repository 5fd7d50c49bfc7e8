"""The numbers of the vehicle's YAML file, each with its origin."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from uam_control.settings import configuration
from uam_control.settings.section import read_section
from uam_control.vehicle import CURRENT_SERVO, DEFAULT_VEHICLE, VehicleDescription
from uam_lab.importing import geometry, rotors
from uam_lab.importing.answers import ASSUMED, DERIVED, FILE, Answers, Told
from uam_lab.importing.source import ImportRefused, RotorFacts
from uam_lab.importing.standing import Stance
from uam_lab.importing.structure import Parts

USUAL = f"vehicle/{DEFAULT_VEHICLE}.yaml"  # whose air, sensors, variation and magnet are taken
GRAVITY = 9.81  # [m/s^2]
WIDEST = 0.75  # of the distance of neighbours: a wider shape is no propeller
MAGNET_MASS = 0.07  # [kg] of parts/magnet.xml, which the import adds
Tree = dict[str, Any]  # of Told, trees and lists of trees


def servo_types() -> dict[str, dict[str, Any]]:
    """Return the servos of config/import/servos.yaml, by type."""
    return read_section(configuration.path("import/servos.yaml"), ImportRefused).values


def masses(parts: Parts) -> float:
    """Return the mass [kg] of all links, without the magnet."""
    return sum(geometry.inertial(parts, link)[0] for link in range(len(parts.joints) + 1))


def magnet_mass(parts: Parts) -> float:
    """Return the mass [kg] of the magnet that the import adds."""
    return MAGNET_MASS if parts.magnet else 0.0


def rotor_numbers(parts: Parts, answers: Answers, mass: float) -> Tree:
    """Return the section `rotors`."""
    layout = _layout(parts, answers)
    radius = _radius(parts, answers)
    thrust, speed = _thrust(parts, answers, mass, radius.value)
    lag = answers.assumed.number("lag_per_radius") * radius.value
    moment = answers.assumed.number("moment_per_radius") * radius.value
    curve = answers.assumed.number("curve_factor")

    def told(name: str, usual: float, why: str) -> Told:
        return answers.number(f"rotors.{name}", usual, why, known=_known(parts, name))

    return {
        "layout": layout,
        "radius": radius,
        "thrust_coefficient": thrust,
        "speed_max": speed,
        "curve_factor": answers.number("rotors.curve_factor", curve, "as of the S-500", 1.0),
        "moment_ratio": told("moment_ratio", moment, "by the radius"),
        "lag_up": told("lag_up", lag, "by the radius"),
        "lag_down": told("lag_down", 2.0 * lag, "twice that of lag_up"),
        "efficiency": Told([1.0] * len(parts.rotors), ASSUMED),
    }


def _layout(parts: Parts, answers: Answers) -> list[Tree]:
    """Return name, position and direction of each rotor, by a layout if the file has none."""
    found = parts.rotors and "rotors.layout" not in answers.given
    laid = None if found else _lay_out(parts, answers)
    turn, why = rotors.turns(parts.rotors)
    origin = (ASSUMED, why) if why else (FILE, "")
    entries = []
    for i, one in enumerate(parts.rotors):
        place = [round(float(x), 4) + 0.0 for x in one.position]
        at = (FILE, one.name) if laid is None else (laid.origin, one.name)
        entry = {"name": f"rotor_{i + 1}", "position": Told(place, *at)}
        way = origin if laid is None else at
        entries.append(entry | {"direction": Told("ccw" if turn[i] else "cw", *way)})
    return entries


def _radius(parts: Parts, answers: Answers) -> Told:
    gap = rotors.neighbours(np.array([one.position for one in parts.rotors]))
    shown = max(one.radius for one in parts.rotors)
    known = Told(float(f"{shown:.4g}"), DERIVED, "half width of the rotor's shape")
    return answers.number(
        "rotors.radius",
        answers.assumed.number("radius_per_gap") * gap,
        "from neighbours' distance",
        known=known if 0.0 < shown < WIDEST * gap else None,
    )


def _thrust(parts: Parts, answers: Answers, mass: float, radius: float) -> tuple[Told, Told]:
    """Return the thrust coefficient [N s^2/rad^2] and the speed [rad/s] at full thrust."""
    assumed, weight = answers.assumed, mass * GRAVITY
    ratio = assumed.number("thrust_to_weight")
    why = f"{ratio:g} times the weight of {weight:.3g} N"
    share, known = ratio * weight / len(parts.rotors), _known(parts, "thrust_max")
    thrust = answers.number("rotors.thrust_max", share, why, known=known)
    usual = float(f"{assumed.number('tip_speed') / radius:.4g}")
    speed = _known(parts, "speed_max") or Told(usual, ASSUMED, "tip speed as of the S-500")
    coefficient = float(f"{thrust.value / speed.value**2:.5g}")
    origin = DERIVED if thrust.origin == FILE else thrust.origin
    reason = f"full thrust {thrust.value:g} N ({thrust}) at speed_max"
    return Told(coefficient, origin, reason), speed


def _known(parts: Parts, name: str) -> Told | None:
    """Return the mean of what the file says of its rotors, None if it says nothing of one."""
    values = [getattr(one.facts, name) for one in parts.rotors]
    if not values or any(value is None for value in values):
        return None
    if max(values) > 1.05 * min(values):
        raise ImportRefused(
            f"{parts.rotors[0].where}: {name} of the rotors is {min(values):g} to {max(values):g}: "
            "one propeller for all is possible"
        )
    return Told(float(f"{np.mean(values):.5g}"), FILE)


def _lay_out(parts: Parts, answers: Answers) -> Told:
    """Place rotors by a layout, as the file has none; return its name."""
    assumed = answers.assumed
    layouts = assumed.mapping("layouts")
    usual = assumed.text("layout")
    if parts.unusable and "rotors.layout" not in answers.given:
        names = ", ".join(f"'{one.name}'" for one in parts.unusable)
        raise ImportRefused(
            f"{parts.unusable[0].where}: rotors at {len(parts.unusable)} places: {names}; "
            f"{rotors.FEWEST} to {rotors.MOST} are possible; "
            f"--set rotors.layout={usual} places others"
        )
    told = answers.name("rotors.layout", usual, "the file has no rotors", layouts)
    chosen = assumed.section("layouts").section(told.value)
    mass, centre, tensor = geometry.inertial(parts, 0)
    gyration = math.sqrt(tensor[2, 2] / mass)
    distance = answers.number(
        "rotors.distance", assumed.number("arm_per_gyration") * gyration, "from the base's inertia"
    )
    count, levels = chosen.whole("places"), chosen.whole("levels")
    first = math.radians(chosen.number("first_deg"))
    where = str(parts.source.file)
    parts.rotors.clear()
    for i in range(count):
        angle = first - 2.0 * math.pi * i / count
        for level in range(levels):
            position = centre + distance.value * np.array([math.cos(angle), math.sin(angle), 0.0])
            position[2] = centre[2] - level * assumed.number("level_gap") + 0.02
            facts = RotorFacts(counter_clockwise=(i + level) % 2 == 0)
            name = f"layout {told.value}"
            parts.rotors.append(
                rotors.FoundRotor(name, where, position, np.array([0.0, 0.0, 1.0]), 0.0, facts)
            )
    parts.notes.append(f"rotors: layout {told.value} ({told}), {distance.value:g} m ({distance})")
    return told


@dataclass
class Servos:
    """The servos of the arm."""

    section: Tree  # `servos` of the YAML file
    types: tuple[str, ...]  # of each joint by name, where they differ, else ()
    stall: tuple[float, ...]  # (n,) [N m]


def servos_of(other: VehicleDescription) -> Servos:
    """Return the servos of the vehicle whose arm was hung."""
    document = read_section(other.file, ImportRefused)
    section = _told(document.mapping("servos"), DERIVED, f"of {other.name}")
    types = tuple(entry.text("servo", default="") for entry in document.entries("joints"))
    return Servos(section, types if all(types) else (), tuple(s.stall_torque for s in other.servos))


def servos_for(parts: Parts, answers: Answers, mass: float) -> Servos:
    """Return servos that hold the arm outstretched: one type, unless an answer says others."""
    assumed, types = answers.assumed, servo_types()
    load = magnet_mass(parts) + assumed.number("payload_share") * mass
    needs = geometry.holding_torques(parts, load, GRAVITY)
    need, share = float(needs.max()), assumed.number("servo_share")
    fitting = [
        name
        for name, one in types.items()
        if share * one["stall_torque"] >= need and one["mode"] == CURRENT_SERVO
    ]
    usual = fitting[0] if fitting else list(types)[-1]
    which = "the smallest that holds" if fitting else "the strongest; none holds"
    why = f"{which} {need:.2f} N m with {share:.0%} of its stall torque"
    told = answers.each("servo", usual, why, types, len(parts.joints))
    stall = tuple(types[name]["stall_torque"] for name in told.value)
    for joint, name, needed, most in zip(parts.joints, told.value, needs, stall, strict=True):
        if most < needed:
            text = f"outstretched it needs {needed:.2f} N m, a {name} has less"
            parts.notes.append(f"joint {parts.model.joint(joint).name}: {text}")
    sections = {
        name: _servo(parts, answers, Told(name, told.origin, told.reason), need)
        for name in dict.fromkeys(told.value)
    }
    if len(sections) == 1:
        return Servos(*sections.values(), (), stall)
    return Servos(sections, tuple(told.value), stall)


def _servo(parts: Parts, answers: Answers, kind: Told, need: float) -> Tree:
    """Return the numbers of one type; need [N m]: largest holding torque of the arm."""
    numbers = servo_types()[kind.value]
    stall = numbers["stall_torque"]
    which = ", ".join(filter(None, (f"type {kind.value}", kind.reason)))
    found = _told(numbers, kind.origin, which)
    share = answers.assumed.number("effort_share")
    found["effort_limit"] = Told(round(share * stall, 3), DERIVED, "from the stall torque")
    stated = [parts.facts(joint).effort for joint in parts.joints]
    if all(need <= one <= stall for one in stated):
        found["effort_limit"] = Told(min(stated), FILE, "smallest effort limit")
    usual = read_section(configuration.path(USUAL), ImportRefused).mapping("servos")
    common = ("position_p_gain", "pwm_limit", "command_latency_ticks")
    return found | _told({key: usual[key] for key in common}, ASSUMED, "as of the S-500")


def _told(values: dict[str, Any], origin: str, reason: str = "") -> Tree:
    return {
        key: _told(value, origin, reason)
        if isinstance(value, dict)
        else Told(value, origin, reason)
        for key, value in values.items()
    }


def document(
    parts: Parts,
    stance: Stance,
    answers: Answers,
    name: str,
    servos: Servos,
) -> Tree:
    """Return the content of the YAML file; the mass is that of the links and the magnet."""
    mass = masses(parts) + magnet_mass(parts)
    usual = read_section(configuration.path(USUAL), ImportRefused)
    drag = [round(mass * one, 3) for one in answers.assumed.numbers("drag_per_mass", 3)]
    air = _told(usual.mapping("air"), ASSUMED)
    air["drag"] = Told(drag, ASSUMED, "by the mass")
    magnet = _told(usual.mapping("magnet"), ASSUMED)
    magnet["holding_force"] = answers.number(
        "magnet.holding_force", magnet["holding_force"].value, "as of the S-500"
    )
    hand: Tree = {"magnet": magnet}
    if not parts.magnet:
        hand = {"end_effector": Told("end_effector", DERIVED, "site of the model")}
    return {
        "model": Told(f"{name}.xml", DERIVED),
        "control_period": Told(0.004, ASSUMED, "250 Hz"),
        "mass": Told(mass, FILE, f"sum of the bodies, magnet of {magnet_mass(parts):g} kg"),
        "gravity": Told(GRAVITY, ASSUMED),
        "rotors": rotor_numbers(parts, answers, mass),
        "joints": [
            {
                "name": parts.model.joint(joint).name,
                "range_deg": stance.ranges[i],
                "stowed_deg": stance.stowed[i],
            }
            | ({"servo": servos.types[i]} if servos.types else {})
            for i, joint in enumerate(parts.joints)
        ],
        "servos": servos.section,
        "air": air,
        "sensors": _told(usual.mapping("sensors"), ASSUMED),
        "variation": _told(usual.mapping("variation"), ASSUMED),
    } | hand
