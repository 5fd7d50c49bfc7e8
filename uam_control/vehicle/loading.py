"""Reader of vehicle descriptions; an invalid description gives a one-line error."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from uam_control.settings import configuration, yaml_file
from uam_control.vehicle.description import (
    AXES,
    Joint,
    Rotor,
    RotorModel,
    Servo,
    VehicleDescription,
)

DEFAULT_VEHICLE = "s500_arm"
DIRECTIONS = ("ccw", "cw")
LEAST_RANGE = 0.1  # [rad] to either side of 0, because the supervisor's limits are symmetric


class VehicleError(ValueError):
    """An incomplete description, or one that contradicts itself or its MJCF; one-line message."""


def load_description(name_or_file: str | Path = DEFAULT_VEHICLE) -> VehicleDescription:
    """Return the vehicle of config/vehicle/NAME.yaml, or of a file.

    Raises VehicleError for an invalid file, ConfigurationError for a name or file that does not
    exist.
    """
    file = configuration.named("vehicle", str(name_or_file), suffixes=(".yaml",))
    document = yaml_file.read(file, VehicleError)
    if not isinstance(document, dict):
        raise VehicleError(f"{file}: a mapping expected, see vehicle/{DEFAULT_VEHICLE}.yaml")
    return describe(document, file)


def describe(document: dict[str, Any], file: Path) -> VehicleDescription:
    """Return the checked description in `document`, the content of `file`. Raises VehicleError."""
    top = Section(document, f"{file}:")
    model = file.parent / top.text("model")
    if not model.is_file():
        raise VehicleError(f"{file}: model: {model} does not exist")
    rotor, servo = top.section("rotors"), top.section("servos")
    profiles = top.section("profiles")
    described = VehicleDescription(
        name=file.stem,
        file=file,
        model=model,
        mass=top.positive("mass"),
        gravity=top.positive("gravity"),
        control_period=top.positive("control_period"),
        rotor=_rotor_model(rotor),
        rotors=tuple(_rotor(entry) for entry in rotor.entries("layout")),
        servo=Servo(
            servo.positive("stall_torque"),
            servo.positive("no_load_speed"),
            servo.positive("effort_limit"),
        ),
        joints=tuple(_joint(entry) for entry in top.entries("joints")),
        profiles={law: profiles.text(law) for law in profiles.values},
        autopilot=top.text("autopilot"),
        autopilot_gains=_autopilot_gains(top),
        numbers=document,
    )
    _check_names(described)
    _check_rotors(described, rotor)
    _check_servo(described.servo, servo)
    return described


def _autopilot_gains(top: Section) -> dict[str, float]:
    """Return the content of the file in config/autopilot; it must not repeat the rotor geometry."""
    file = configuration.named("autopilot", top.text("autopilot"))
    values = yaml_file.read(file, VehicleError)
    if not isinstance(values, dict):
        raise VehicleError(f"{file}: 'NAME: value' lines expected")
    for name in values:
        if str(name).startswith("CA_") or name in ("THR_MDL_FAC", "MPC_THR_HOVER"):
            raise VehicleError(f"{file}: remove {name}: it is derived from {top.where[:-1]}")
    gains = Section(values, f"{file}:")
    for axis in AXES:  # the torque mapping of the bridge uses them
        gains.positive(f"MC_{axis}RATE_P")
    return values


def _rotor_model(rotor: Section) -> RotorModel:
    factor = rotor.number("curve_factor")
    if not 0.0 <= factor <= 1.0:
        raise VehicleError(f"{rotor.where}.curve_factor: {factor:g} is outside 0..1")
    names = ("thrust_coefficient", "speed_max", "moment_ratio", "lag_up", "lag_down", "radius")
    return RotorModel(curve_factor=factor, **{name: rotor.positive(name) for name in names})


def _rotor(entry: Section) -> Rotor:
    position = entry.numbers("position", 3)
    direction = entry.text("direction")
    if direction not in DIRECTIONS:
        raise VehicleError(
            f"{entry.where}.direction: '{direction}' is not one of {', '.join(DIRECTIONS)}"
        )
    return Rotor(entry.text("name"), position, direction == DIRECTIONS[0])


def _joint(entry: Section) -> Joint:
    low, high = (math.radians(limit) for limit in entry.numbers("range_deg", 2))
    stowed = math.radians(entry.number("stowed_deg"))
    if not (low <= -LEAST_RANGE and high >= LEAST_RANGE):
        raise VehicleError(
            f"{entry.where}.range_deg: {entry.values['range_deg']} does not have "
            f"{math.degrees(LEAST_RANGE):.1f} deg to either side of 0"
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
    rotor.numbers("efficiency", count)
    full = count * described.rotor.thrust_max
    weight = described.mass * described.gravity
    if weight >= full:
        raise VehicleError(
            f"{described.file}: mass: a weight of {weight:.1f} N is not below the full thrust of "
            f"the rotors, {full:.1f} N"
        )


def _check_servo(servo: Servo, section: Section) -> None:
    if servo.effort_limit > servo.stall_torque:
        raise VehicleError(
            f"{section.where}.effort_limit: {servo.effort_limit:g} N m is above stall_torque, "
            f"{servo.stall_torque:g} N m"
        )


class Section:
    """A mapping of the file; its methods check one entry and raise VehicleError with its place."""

    def __init__(self, values: dict[str, Any], where: str) -> None:
        self.values, self.where = values, where

    def section(self, key: str) -> Section:
        """Return the entry `key`, a mapping."""
        value = self._entry(key)
        if not isinstance(value, dict) or not value:
            raise VehicleError(f"{self._name(key)}: a mapping expected, got {value!r}")
        return Section(value, self._name(key))

    def entries(self, key: str) -> list[Section]:
        """Return the entry `key`, a list of one mapping or more."""
        value = self._entry(key)
        if not isinstance(value, list) or not value:
            raise VehicleError(f"{self._name(key)}: a list of mappings expected, got {value!r}")
        found = []
        for i, entry in enumerate(value):
            if not isinstance(entry, dict):
                raise VehicleError(f"{self._name(key)}[{i}]: a mapping expected, got {entry!r}")
            found.append(Section(entry, f"{self._name(key)}[{i}]"))
        return found

    def text(self, key: str) -> str:
        """Return the entry `key`, a text that is not empty."""
        value = self._entry(key)
        if not isinstance(value, str) or not value:
            raise VehicleError(f"{self._name(key)}: a name expected, got {value!r}")
        return value

    def number(self, key: str) -> float:
        """Return the entry `key`, a finite number."""
        return self._checked(key, self._entry(key))

    def positive(self, key: str) -> float:
        """Return the entry `key`, a finite number above 0."""
        value = self.number(key)
        if value <= 0.0:
            raise VehicleError(f"{self._name(key)}: {value:g} is not above 0")
        return value

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        """Return the entry `key`, a list of `count` finite numbers."""
        value = self._entry(key)
        if not isinstance(value, list) or len(value) != count:
            raise VehicleError(f"{self._name(key)}: a list of {count} numbers expected: {value!r}")
        return tuple(self._checked(key, item) for item in value)

    def _entry(self, key: str) -> Any:
        if key not in self.values:
            raise VehicleError(f"{self._name(key)} is missing")
        return self.values[key]

    def _checked(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise VehicleError(f"{self._name(key)}: a number expected, got {value!r}")
        if not math.isfinite(value):
            raise VehicleError(f"{self._name(key)}: {value!r} is not finite")
        return float(value)

    def _name(self, key: str) -> str:
        return f"{self.where}{' ' if self.where.endswith(':') else '.'}{key}"
