"""Scenarios, read from YAML files (config/scenarios) or CSV trajectories."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from uam_control.coordinates import (
    ARM,
    CHI,
    CHI_DDOT,
    CHI_DOT,
    POSITION,
    YAW,
    arm_coordinates,
    coordinates,
)
from uam_control.mission.trajectory import Chain, Move, Moves, Sampled, Trajectory
from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section
from uam_control.vehicle import VehicleDescription, load_description

CSV_REQUIRED = ("t", "px", "py", "pz", "yaw", "vx", "vy", "vz", "ax", "ay", "az", "dyaw")


class ScenarioError(ValueError):
    """An invalid scenario; the text is one line: where, what is wrong, what is allowed."""


@dataclass(frozen=True)
class Landing:
    """Descent from mission time `at` [s] for `duration` [s], to the height of the take-off."""

    at: float
    duration: float


@dataclass(frozen=True)
class Scenario:
    """A flight: moves or samples, phases, magnet switching, landing.

    Times are mission times [s]. arm_start: joint angles at take-off [rad]; payload_mass [kg];
    drop_point: x, y [m]; phases, magnet, snapshots: (begin, value).
    """

    name: str
    description: str
    arm_start: tuple[float, ...]
    phases: tuple[tuple[float, str], ...]
    landing: Landing
    moves: tuple[Move, ...] = ()
    samples: Sampled | None = None
    samples_start: float = 0.0
    magnet: tuple[tuple[float, bool], ...] = ()
    payload_mass: float = 0.0
    drop_point: tuple[float, float] | None = None
    snapshots: tuple[tuple[float, str], ...] = field(default=())
    faults: tuple[object, ...] = ()  # unchecked entries, see uam_sim_bridge.faults

    def trajectory(self, start: np.ndarray) -> Trajectory:
        """Return the reference from `start` (chi at take-off) to the landing point."""
        ground = start[2]
        down = Move("z", self.landing.at, self.landing.at + self.landing.duration, ground - SINK)
        if self.samples is None:
            return Moves(start, [*self.moves, down])
        names = coordinates(len(self.arm_start))
        climb = [
            Move(name, 0.0, self.samples_start, value)
            for name, value in zip(names, self.samples.first, strict=True)
        ]
        down = Move("z", 0.0, self.landing.duration, ground - SINK)
        parts = Moves(start, climb), self.samples, Moves(self.samples.last, [down])
        starts = 0.0, self.samples_start, self.landing.at
        return Chain(list(zip(starts, parts, strict=True)))

    def phase(self, time: float) -> str:
        """Return the name of the phase at mission time `time` [s] >= 0."""
        for start, name in reversed(self.phases):
            if time >= start:
                return name
        raise ValueError(f"no phase at {time} s")

    def magnet_on(self, time: float) -> bool:
        """Return the desired state of the magnet at mission time `time` [s]."""
        for at, on in reversed(self.magnet):
            if time >= at:
                return on
        return False


SINK = 0.03  # m, depth of the landing reference below the ground, for a firm contact


def load_scenario(name_or_file: str, vehicle: VehicleDescription | None = None) -> Scenario:
    """Return a scenario by name, or from a .yaml or .csv file; raises ScenarioError.

    vehicle: that it is for, None for the default one.
    """
    vehicle = vehicle or load_description()
    file = Path(name_or_file)
    if file.suffix not in (".yaml", ".csv"):
        try:
            file = configuration.named("scenarios", name_or_file)
        except configuration.ConfigurationError as error:
            raise ScenarioError(str(error)) from None
    try:
        return from_csv(file, vehicle) if file.suffix == ".csv" else from_yaml(file, vehicle)
    except OSError as error:
        raise ScenarioError(f"{file}: {error.strerror}") from None


def from_yaml(file: Path, vehicle: VehicleDescription) -> Scenario:
    """Read a scenario file; see config/scenarios/pick_and_place.yaml for the form.

    Without arm_start the arm begins stowed.
    """
    top = read_section(file, ScenarioError)
    arm_start = _arm_start(top, vehicle)
    landing = top.section("landing")
    phases = [(p.number("from"), p.values.get("name", "")) for p in top.entries("phases", True)]
    payload = top.section("payload") if top.values.get("payload") else None
    faults = top.values.get("faults") or []
    if not isinstance(faults, list):
        raise ScenarioError(f"{file}: 'faults' is not a list")
    return Scenario(
        name=file.stem,
        description=str(top.values.get("description", "")),
        arm_start=arm_start,
        phases=tuple((start, str(name)) for start, name in phases or [(0.0, "flight")]),
        landing=Landing(landing.number("at"), landing.number("duration")),
        moves=_moves(top, vehicle),
        magnet=tuple((m.number("at"), m.switch("energised")) for m in top.entries("magnet", True)),
        payload_mass=payload.number("mass") if payload else 0.0,
        drop_point=(
            payload.numbers("drop_point", 2) if payload and "drop_point" in payload.values else None
        ),
        snapshots=tuple(
            (s.number("at"), str(s.values.get("caption", "")))
            for s in top.entries("snapshots", True)
        ),
        faults=tuple(faults),
    )


def _arm_start(top: Section, vehicle: VehicleDescription) -> tuple[float, ...]:
    """Return the joint angles [rad] on the ground: `arm_start`, or stowed."""
    if "arm_start" not in top.values:
        return vehicle.stowed
    arm, joints = top.section("arm_start"), arm_coordinates(len(vehicle.joints))
    expected = [f"{name}_deg" for name in joints]
    for name in arm.values:
        if name not in expected:
            has = f"{vehicle.name} has: {', '.join(expected)}"
            raise ScenarioError(f"{arm.where}.{name}: no joint; {has}")
    return tuple(_angle(arm, f"{name}_deg", name, vehicle) for name in joints)


def _angle(entry: Section, key: str, coordinate: str, vehicle: VehicleDescription) -> float:
    """Return an angle [rad]; a joint's must be within its range."""
    angle = math.radians(entry.number(key))
    joints = dict(zip(arm_coordinates(len(vehicle.joints)), vehicle.joints, strict=True))
    joint = joints.get(coordinate)
    if joint is not None and not joint.low <= angle <= joint.high:
        raise ScenarioError(
            f"{entry.where}.{key}: {entry.values[key]:g}; {vehicle.name} allows "
            f"{math.degrees(joint.low):g} to {math.degrees(joint.high):g}"
        )
    return angle


def _moves(top: Section, vehicle: VehicleDescription) -> tuple[Move, ...]:
    """Return `moves`; angles are in degrees. Moves of one coordinate must not overlap in time."""
    moves = tuple(_move(entry, vehicle) for entry in top.entries("moves", True))
    last: dict[str, Move] = {}
    for move in sorted(moves, key=lambda m: m.start):
        before = last.get(move.coordinate)
        if before and before.end > move.start:
            raise ScenarioError(
                f"{top.where} two moves of {move.coordinate} overlap at {move.start} s"
            )
        last[move.coordinate] = move
    return moves


def _move(entry: Section, vehicle: VehicleDescription) -> Move:
    coordinate = entry.text("coordinate")
    allowed = [c for c in vehicle.coordinates if c not in ("roll", "pitch")]
    if coordinate not in allowed:
        raise ScenarioError(
            f"{entry.where}.coordinate: {coordinate!r}, allowed: {', '.join(allowed)}"
        )
    length = coordinate in ("x", "y", "z")
    target = entry.number("to") if length else _angle(entry, "to_deg", coordinate, vehicle)
    start, end = entry.number("from"), entry.number("until")
    if end <= start:
        raise ScenarioError(f"{entry.where}: ends at {end} s, before it begins")
    return Move(coordinate, start, end, target)


def from_csv(
    file: Path, vehicle: VehicleDescription, takeoff: float = 3.0, landing: float = 5.0
) -> Scenario:
    """Read a trajectory with the columns of CSV_REQUIRED (SI, ENU) and optionally alpha_1..n.

    A take-off of `takeoff` [s] to the first point precedes it, a landing of `landing` [s] below the
    last point follows. Raises ScenarioError with line and column.
    """
    with file.open(newline="") as lines:
        rows = csv.DictReader(lines)
        columns = [name.strip() for name in rows.fieldnames or []]
        rows.fieldnames = columns
        missing = [name for name in CSV_REQUIRED if name not in columns]
        if missing:
            needed = f"needed: {','.join(CSV_REQUIRED)}"
            raise ScenarioError(f"{file} line 1: column {', '.join(missing)} is missing; {needed}")
        joints = arm_coordinates(len(vehicle.joints))
        optional = [name for name in joints if name in columns]
        needed = f"{vehicle.name} has: {','.join(joints)}"
        if optional and len(optional) < len(joints):
            lacking = next(name for name in joints if name not in columns)
            raise ScenarioError(f"{file} line 1: {optional[0]} without {lacking}; {needed}")
        strange = [c for c in columns if c.startswith("alpha") and c not in joints]
        if strange:
            raise ScenarioError(f"{file} line 1: column {strange[0]}; {needed}")
        names = (*CSV_REQUIRED, *optional)
        table = np.array([_csv_row(file, i, row, names) for i, row in enumerate(rows, start=2)])
    if len(table) < 2:
        raise ScenarioError(f"{file}: at least two rows expected, got {len(table)}")
    times = table[:, 0]
    backward = np.flatnonzero(np.diff(times) <= 0.0)
    if len(backward):
        line = int(backward[0]) + 3
        raise ScenarioError(f"{file} line {line} column t: time does not increase")
    if np.any(table[:, 3] <= 0.0):
        line = int(np.argmax(table[:, 3] <= 0.0)) + 2
        raise ScenarioError(f"{file} line {line} column pz: below the ground")
    samples = np.zeros((len(table), 3, len(vehicle.coordinates)))
    for row, first in enumerate((1, 5, 8)):
        samples[:, row, POSITION] = table[:, first : first + 3]
    samples[:, CHI, YAW] = table[:, 4]
    samples[:, CHI_DOT, YAW] = table[:, 11]
    samples[:, CHI_DDOT, YAW] = np.gradient(table[:, 11], times)
    arm_start = vehicle.stowed
    samples[:, CHI, ARM] = arm_start
    if optional:
        samples[:, CHI, ARM] = table[:, len(CSV_REQUIRED) :]
        _check_angles(file, samples[:, CHI, ARM], vehicle)
        for row in (CHI_DOT, CHI_DDOT):
            samples[:, row, ARM] = np.gradient(samples[:, row - 1, ARM], times, axis=0)
    end = takeoff + float(times[-1] - times[0])
    return Scenario(
        name=file.stem,
        description=f"trajectory from {file.name}",
        arm_start=arm_start,
        phases=((0.0, "take-off"), (takeoff, "trajectory"), (end + 1.0, "land")),
        landing=Landing(end + 1.0, landing),
        samples=Sampled(times - times[0], samples),
        samples_start=takeoff,
    )


def _check_angles(file: Path, angles: np.ndarray, vehicle: VehicleDescription) -> None:
    """Raise ScenarioError for the first of angles (rows, n) [rad] out of its joint's range."""
    low = np.array([joint.low for joint in vehicle.joints])
    high = np.array([joint.high for joint in vehicle.joints])
    beyond = np.argwhere((angles < low) | (angles > high))
    if len(beyond):
        row, i = beyond[0]
        raise ScenarioError(
            f"{file} line {row + 2} column alpha_{i + 1}: joint angle beyond its range, "
            f"{low[i]:.2f} to {high[i]:.2f} rad"
        )


def _csv_row(file: Path, line: int, row: dict, names: tuple[str, ...]) -> list[float]:
    numbers = []
    for name in names:
        try:
            value = float(row[name])
        except (TypeError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            raise ScenarioError(
                f"{file} line {line} column {name}: {row[name]!r} is not a finite number"
            )
        numbers.append(value)
    return numbers
