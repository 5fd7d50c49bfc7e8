"""Reader of vehicle descriptions; an invalid description gives a one-line error."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section
from uam_control.vehicle.description import (
    AXES,
    SERVO_MODES,
    Joint,
    Rotor,
    RotorModel,
    Servo,
    VehicleDescription,
)
from uam_control.vehicle.gripper import check_gripper, completed
from uam_control.vehicle.rotor_geometry import normalised_mixer

DEFAULT_VEHICLE = "s500_arm"
DIRECTIONS = ("ccw", "cw")
LONGEST_PERIOD = 0.008  # [s] of a tick: the attitude loop oscillates in yaw with 10 ms
HOVERS = 0.1, 0.8  # share of the full thrust in hover: the range of the autopilot, MPC_THR_HOVER
# kinds of the files that `uam vehicle design` writes, and the law of its profiles
PROFILE_FILE, AUTOPILOT_FILE, DESIGNED_LAW = "profile", "autopilot", "modular"
SLOWEST_ROTOR = 1.0  # [s] time constant of a rotor's speed
LEAST_RANGE = 0.2  # [rad] of a joint: the supervisor holds at its ends
# of the bus and its driver, which are one
COMMON = "mode", "command_latency_ticks", "position_p_gain", "pwm_limit"
# entries that only the description and what is made of it read; a change of them has no effect
NOT_OF_THE_PLANT = (
    *("model", "profiles", "autopilot", "control_period", "mass", "gravity", "joints", "arm"),
    *("end_effector", "gripper.kind", "gripper.type", "gripper.model", "gripper.body"),
    *("gripper.instead_of", "gripper.position", "gripper.mass", "gripper.friction"),
    "gripper.grip_depth",
    *("rotors.layout", "rotors.radius", "rotors.moment_ratio"),
    *("servos.effort_limit", "servos.load_friction"),
)
LEAST_RATE, LARGEST_RATE = 30.0, 360.0  # [Hz] of poses with which the estimator is made to fly


class VehicleError(ValueError):
    """An incomplete description, or one that contradicts itself or its MJCF; one-line message."""


def load_description(name_or_file: str | Path = DEFAULT_VEHICLE) -> VehicleDescription:
    """Return the vehicle of config/vehicle/NAME.yaml, or of a file.

    Raises VehicleError for an invalid file, ConfigurationError for a name or file that does not
    exist.
    """
    file = configuration.named("vehicle", str(name_or_file), suffixes=(".yaml",))
    return describe(_derived(file), file)


def _derived(file: Path, above: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Return the content of a vehicle's file; with `derives`, its entries replace those of the
    vehicle that it names, entry by entry; null leaves one out. Its own design acts, too."""
    top = read_section(file, VehicleError)
    if not top.has("derives"):
        return top.values
    other = configuration.named(
        "vehicle", configuration.beside(file, "vehicle", top.text("derives")), (".yaml",)
    )
    if other.resolve() in (*above, file.resolve()):
        raise top.error("derives", f"{other.name} derives from {file.name}")
    base = _with_paths(_derived(other, (*above, file.resolve())), other)
    for key, kind in (("profiles", PROFILE_FILE), ("autopilot", AUTOPILOT_FILE)):
        if designed(file, kind).is_file():
            base.pop(key, None)
    own = {key: value for key, value in top.values.items() if key != "derives"}
    return _replaced(base, own)


def _with_paths(document: dict[str, Any], file: Path) -> dict[str, Any]:
    """Return the content of a vehicle's `file` for a file elsewhere: with its design, and with
    whole paths of the files that stand beside it."""
    here, found = Section(document, f"{file}:", VehicleError), dict(document)
    found["model"] = str(file.parent / here.text("model"))
    if profiles := _profiles(here, file):
        found["profiles"] = profiles
    own = designed(file, AUTOPILOT_FILE)
    if here.has("autopilot"):
        found["autopilot"] = configuration.beside(file, "autopilot", here.text("autopilot"))
    elif own.is_file():
        found["autopilot"] = str(own)
    gripper = document.get("gripper")
    if isinstance(gripper, dict) and "type" in gripper:
        named = configuration.beside(file, "grippers", str(gripper["type"]))
        found["gripper"] = gripper | {"type": named}
    return found


def _replaced(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Return `base` with the entries of `own` in it, mappings entry by entry, without nulls."""
    found = base | own
    for key in base.keys() & own.keys():
        if isinstance(base[key], dict) and isinstance(own[key], dict):
            found[key] = _replaced(base[key], own[key])
    return {key: value for key, value in found.items() if value is not None}


def designed(file: Path, kind: str) -> Path:
    """Return the file of a design beside the vehicle's `file`; it acts where that names none."""
    return file.with_name(f"{file.stem}_{kind}.yaml")


def describe(document: dict[str, Any], file: Path) -> VehicleDescription:
    """Return the checked description in `document`, the content of `file`. Raises VehicleError."""
    document = completed(document, file, VehicleError)
    top = Section(document, f"{file}:", VehicleError)
    model = file.parent / top.text("model")
    if not model.is_file():
        raise VehicleError(f"{file}: model: {model} does not exist")
    rotor, servos = top.section("rotors"), servo_types(top)
    described = VehicleDescription(
        name=file.stem,
        file=file,
        model=model,
        mass=top.positive("mass"),
        gravity=top.positive("gravity"),
        control_period=_control_period(top),
        rotor=_rotor_model(rotor),
        rotors=tuple(_rotor(entry) for entry in rotor.entries("layout")),
        servos=tuple(_servo(one) for one in servos),
        joints=tuple(_joint(entry) for entry in top.entries("joints")),
        end_effector=top.text("end_effector", default=""),
        profiles=_profiles(top, file),
        autopilot=top.text("autopilot", default=""),
        autopilot_gains=_autopilot_gains(top, file),
        numbers=document | {"servos": merged(servos)},
    )
    _check_names(described)
    _check_rotors(described, rotor)
    _check_hover(described)
    check_plant_numbers(top, servos)
    check_gripper(top)
    top.has("arm")  # of older files: told in a note of the flight
    top.only_asked()
    return described


def _control_period(top: Section) -> float:
    period = top.positive("control_period")
    if period > LONGEST_PERIOD:
        raise top.error("control_period", f"{period:g} s is above {LONGEST_PERIOD:g} s")
    return period


def _profiles(top: Section, file: Path) -> dict[str, str]:
    """Return the profiles by law; where the vehicle has no such entry, that of its design."""
    if top.has("profiles"):
        given = top.section("profiles")
        return {
            law: configuration.beside(file, "profiles", given.text(law)) for law in given.values
        }
    own = designed(file, PROFILE_FILE)
    return {DESIGNED_LAW: str(own)} if own.is_file() else {}


def _autopilot_gains(top: Section, described_in: Path) -> dict[str, float]:
    """Return the content of the file in config/autopilot, or of the design; {} without either.

    It must not repeat the rotor geometry.
    """
    if top.has("autopilot"):
        given = configuration.beside(described_in, "autopilot", top.text("autopilot"))
        file = configuration.named("autopilot", given)
    elif not (file := designed(described_in, AUTOPILOT_FILE)).is_file():
        return {}
    gains = read_section(file, VehicleError)
    for name in gains.values:
        if str(name).startswith("CA_") or name in ("THR_MDL_FAC", "MPC_THR_HOVER"):
            raise VehicleError(f"{file}: remove {name}: it is derived from {top.where[:-1]}")
    for axis in AXES:  # the torque mapping of the bridge uses them
        gains.positive(f"MC_{axis}RATE_P")
    return gains.values


def _rotor_model(rotor: Section) -> RotorModel:
    factor = rotor.number("curve_factor")
    if not 0.0 <= factor <= 1.0:
        raise VehicleError(f"{rotor.where}.curve_factor: {factor:g} is outside 0..1")
    names = ("thrust_coefficient", "speed_max", "moment_ratio", "lag_up", "lag_down", "radius")
    for name in ("lag_up", "lag_down"):
        if (lag := rotor.positive(name)) > SLOWEST_ROTOR:
            raise rotor.error(name, f"{lag:g} s; in ms? at most {SLOWEST_ROTOR:g} s")
    return RotorModel(curve_factor=factor, **{name: rotor.positive(name) for name in names})


def _rotor(entry: Section) -> Rotor:
    position = entry.numbers("position", 3)
    direction = entry.one_of("direction", DIRECTIONS)
    return Rotor(entry.text("name"), position, direction == DIRECTIONS[0])


def _joint(entry: Section) -> Joint:
    low, high = (math.radians(limit) for limit in entry.numbers("range_deg", 2))
    stowed = math.radians(entry.number("stowed_deg"))
    if high - low < LEAST_RANGE:
        raise VehicleError(
            f"{entry.where}.range_deg: {entry.values['range_deg']} is less than "
            f"{math.degrees(LEAST_RANGE):.1f} deg wide"
        )
    if not low <= stowed <= high:
        raise VehicleError(
            f"{entry.where}.stowed_deg: {entry.values['stowed_deg']} is outside the joint's range"
        )
    return Joint(entry.text("name"), low, high, stowed)


def _check_names(described: VehicleDescription) -> None:
    names = (*described.rotor_names, *described.joint_names)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise VehicleError(f"{described.file}: {', '.join(twice)}: the name of several parts")


def _check_rotors(described: VehicleDescription, rotor: Section) -> None:
    count = len(described.rotors)
    if not 4 <= count <= 12:
        raise VehicleError(f"{rotor.where}.layout: {count} rotors; 4 to 12 are possible")
    try:
        normalised_mixer(*described.geometry())
    except ValueError as error:
        raise VehicleError(f"{rotor.where}.layout: {error}") from None
    by_place: dict[tuple[float, ...], str] = {}
    for one in described.rotors:
        if (other := by_place.setdefault(one.position, one.name)) != one.name:
            text = f"{one.name} is where {other} is; coaxial ones differ in z"
            raise VehicleError(f"{rotor.where}.layout: {text}")
    rotor.numbers("efficiency", count)


def _check_hover(described: VehicleDescription) -> None:
    low, high = HOVERS
    if not low <= described.hover_command <= high:
        weight, full = described.mass * described.gravity, described.full_thrust
        raise VehicleError(
            f"{described.file}: mass: to hover, a weight of {weight:.1f} N, needs "
            f"{100 * weight / full:.3g} % of the full thrust of the rotors, {full:.1f} N; "
            f"{100 * low:g} to {100 * high:g} % are possible"
        )


def _servo(section: Section) -> Servo:
    servo = Servo(*map(section.positive, ("stall_torque", "no_load_speed", "effort_limit")))
    section.one_of("mode", SERVO_MODES)
    section.positive("position_p_gain")
    section.positive("pwm_limit")
    if servo.effort_limit > servo.stall_torque:
        raise VehicleError(
            f"{section.where}.effort_limit: {servo.effort_limit:g} N m is above stall_torque, "
            f"{servo.stall_torque:g} N m"
        )
    return servo


def servo_types(top: Section) -> list[Section]:
    """Return the entries of the servo of each joint.

    `servos` is one type, or a mapping of types by name; then each joint has the name of its
    `servo`. Raises the section's error for a joint without one, and for types that differ in what
    is common to a bus.
    """
    servos, joints = top.section("servos"), top.entries("joints")
    if not all(isinstance(value, dict) for value in servos.values.values()):
        if chosen := [joint for joint in joints if joint.has("servo")]:
            raise chosen[0].error("servo", "servos has no types by name, but one type for all")
        return [servos] * len(joints)
    types = {name: servos.section(name) for name in servos.values}
    chosen = [joint.one_of("servo", types) for joint in joints]
    if unused := [name for name in types if name not in chosen]:
        raise servos.error(unused[0], "no joint has this servo")
    for key in COMMON:
        if any(one.entry(key) != types[chosen[0]].entry(key) for one in types.values()):
            values = ", ".join(f"{name} {one.values[key]}" for name, one in types.items())
            raise servos.error(key, f"{values}: the servos of one bus have the same")
    return [types[name] for name in chosen]


def merged(servos: list[Section]) -> dict[str, Any]:
    """Return the entries of all joints as one mapping; a list where joints differ."""
    entries = {}
    for key in servos[0].values:
        if lacking := [one for one in servos if key not in one.values]:
            raise lacking[0].error(key, "missing; another type has it")
        values = [one.values[key] for one in servos]  # not asked for: an unknown one is refused
        entries[key] = values[0] if all(one == values[0] for one in values) else values
    return entries


def check_plant_numbers(top: Section, servos: list[Section]) -> None:
    """Raise the section's error for a bad entry of plant or drivers only; servos: of each joint."""
    air = top.section("air")
    if min(drag := air.numbers("drag", 3)) < 0.0:
        raise air.error("drag", f"{min(drag):g} N s/m is below 0")
    air.numbers("wind", 3)
    air.not_negative("gust")
    air.positive("gust_time")
    sensors = top.section("sensors")
    sensors.not_negative("noise_scale")
    mocap, imu, joints = (sensors.section(name) for name in ("mocap", "imu", "joints"))
    rate = mocap.number("rate")
    if not LEAST_RATE <= rate <= LARGEST_RATE:
        allowed = f"{LEAST_RATE:g} to {LARGEST_RATE:g} Hz"
        raise mocap.error("rate", f"{rate:g} Hz; allowed: {allowed}")
    joints.positive("counts_per_turn")
    joints.positive("velocity_unit")
    for name in ("position_noise", "attitude_noise"):
        mocap.not_negative(name)
    for name in ("gyro_noise", "gyro_bias", "accelerometer_noise", "accelerometer_bias"):
        imu.not_negative(name)
    if mocap.has("payload"):
        mocap.switch("payload")
    for sensor in (mocap, imu, joints):
        sensor.whole("latency_ticks")
    for servo in servos:
        servo.whole("command_latency_ticks")
        if servo.has("load_friction"):
            servo.not_negative("load_friction")
        for name in filter(servo.has, ("torque_per_current", "current_unit")):
            servo.positive(name)
    variation = top.section("variation")
    for name in ("mass", "inertia"):
        variation.positive(name)
    variation.numbers("payload_offset", 2)
    if variation.has("base_offset"):
        variation.numbers("base_offset", 3 if len(variation.entry("base_offset")) == 3 else 2)
    if variation.has("tip_mass"):
        variation.not_negative("tip_mass")
    if not top.has("magnet"):
        return
    magnet = top.section("magnet")
    magnet.positive("holding_force")
    magnet.positive("gap_scale")
    if magnet.has("curve"):
        check_curve(magnet)


def check_curve(magnet: Section) -> None:
    """Raise the section's error if `curve` is no list of [gap [m], fraction 0..1], by gap."""
    curve = magnet.entry("curve")
    try:
        points = np.array(curve, dtype=float) if curve else np.zeros((0, 2))
    except (TypeError, ValueError):
        points = np.full((1, 2), np.nan)
    usable = points.ndim == 2 and points.shape[1] == 2 and np.all(points >= 0.0)
    if not usable or np.any(np.diff(points[:, 0]) <= 0.0) or np.any(points[:, 1] > 1.0):
        allowed = "[[gap in m, fraction 0 to 1], ...] by growing gaps"
        raise magnet.error("curve", f"{curve}; allowed: {allowed}")
