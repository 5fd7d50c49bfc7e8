"""Scenarios, read from YAML files (config/scenarios) or CSV trajectories."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
from uam_control.settings import configuration, yaml_file
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
        climb = [
            Move(name, 0.0, self.samples_start, value)
            for name, value in zip(
                coordinates(len(self.arm_start)), self.samples.first, strict=True
            )
        ]
        return Chain(
            [
                (0.0, Moves(start, climb)),
                (self.samples_start, self.samples),
                (
                    self.landing.at,
                    Moves(
                        self.samples.last, [Move("z", 0.0, self.landing.duration, ground - SINK)]
                    ),
                ),
            ]
        )

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
    document = yaml_file.read(file, ScenarioError)
    if not isinstance(document, dict):
        raise ScenarioError(f"{file}: a mapping expected, see scenarios/pick_and_place.yaml")
    reader = Reader(str(file), vehicle)
    arm_start = reader.arm_start(document)
    landing = reader.mapping(document, "landing")
    moves = [reader.move(entry, i) for i, entry in enumerate(document.get("moves") or [])]
    reader.no_overlap(moves)
    phases = tuple(
        (reader.number(p, "from", "phases"), str(p.get("name", "")))
        for p in document.get("phases") or [{"from": 0.0, "name": "flight"}]
    )
    magnet = tuple(
        (reader.number(m, "at", "magnet"), reader.switch(m, "energised", "magnet"))
        for m in document.get("magnet") or []
    )
    payload = document.get("payload") or {}
    drop = payload.get("drop_point")
    return Scenario(
        name=file.stem,
        description=str(document.get("description", "")),
        arm_start=arm_start,
        phases=phases,
        landing=Landing(
            reader.number(landing, "at", "landing"), reader.number(landing, "duration", "landing")
        ),
        moves=tuple(moves),
        magnet=magnet,
        payload_mass=reader.number(payload, "mass", "payload") if payload else 0.0,
        drop_point=(float(drop[0]), float(drop[1])) if drop else None,
        snapshots=tuple(
            (reader.number(s, "at", "snapshots"), str(s.get("caption", "")))
            for s in document.get("snapshots") or []
        ),
        faults=reader.entries(document, "faults"),
    )


class Reader:
    """Reads entries of a scenario file; its errors name file and entry."""

    def __init__(self, where: str, vehicle: VehicleDescription) -> None:
        self.where, self.vehicle = where, vehicle
        self.joints = dict(zip(arm_coordinates(len(vehicle.joints)), vehicle.joints, strict=True))

    def arm_start(self, document: dict) -> tuple[float, ...]:
        """Return the joint angles [rad] on the ground: `arm_start`, or stowed."""
        if "arm_start" not in document:
            return self.vehicle.stowed
        arm = self.mapping(document, "arm_start")
        expected = [f"{name}_deg" for name in self.joints]
        strange = [name for name in arm if name not in expected]
        if strange:
            raise ScenarioError(
                f"{self.where}: 'arm_start.{strange[0]}': {self.vehicle.name} has: "
                + ", ".join(expected)
            )
        return tuple(
            self.angle(name, self.number(arm, f"{name}_deg", "arm_start"), f"arm_start.{name}_deg")
            for name in self.joints
        )

    def angle(self, coordinate: str, degrees: float, owner: str) -> float:
        """Return an angle [rad]; a joint's must be within its range."""
        angle, joint = math.radians(degrees), self.joints.get(coordinate)
        if joint is not None and not joint.low <= angle <= joint.high:
            raise ScenarioError(
                f"{self.where}: '{owner}' is {degrees:g}, {self.vehicle.name} allows "
                f"{math.degrees(joint.low):g} to {math.degrees(joint.high):g}"
            )
        return angle

    def mapping(self, document: dict, key: str) -> dict:
        """Return a required mapping."""
        value = document.get(key)
        if not isinstance(value, dict):
            raise ScenarioError(f"{self.where}: '{key}' is missing or not a mapping")
        return value

    def entries(self, document: dict, key: str) -> tuple[object, ...]:
        """Return an optional list."""
        value = document.get(key) or []
        if not isinstance(value, list):
            raise ScenarioError(f"{self.where}: '{key}' is not a list")
        return tuple(value)

    def number(self, entry: Any, key: str, owner: str) -> float:
        """Return a required finite number."""
        value = entry.get(key) if isinstance(entry, dict) else None
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise ScenarioError(f"{self.where}: '{owner}.{key}' is {value!r}, a number expected")
        return float(value)

    def switch(self, entry: Any, key: str, owner: str) -> bool:
        """Return a required true or false."""
        value = entry.get(key) if isinstance(entry, dict) else None
        if not isinstance(value, bool):
            raise ScenarioError(
                f"{self.where}: '{owner}.{key}' is {value!r}, true or false expected"
            )
        return value

    def move(self, entry: Any, index: int) -> Move:
        """Return an entry of `moves`; angles are in degrees; roll and pitch are not allowed."""
        owner = f"moves[{index}]"
        coordinate = entry.get("coordinate") if isinstance(entry, dict) else None
        allowed = [c for c in self.vehicle.coordinates if c not in ("roll", "pitch")]
        if coordinate not in allowed:
            raise ScenarioError(
                f"{self.where}: '{owner}.coordinate' is {coordinate!r}, "
                f"allowed: {', '.join(allowed)}"
            )
        angle = coordinate not in ("x", "y", "z")
        target = self.number(entry, "to_deg" if angle else "to", owner)
        start, end = self.number(entry, "from", owner), self.number(entry, "until", owner)
        if end <= start:
            raise ScenarioError(f"{self.where}: '{owner}' ends at {end} s, before it begins")
        if angle:
            target = self.angle(coordinate, target, f"{owner}.to_deg")
        return Move(coordinate, start, end, target)

    def no_overlap(self, moves: list[Move]) -> None:
        """Raise ScenarioError if two moves of one coordinate overlap in time."""
        last: dict[str, Move] = {}
        for move in sorted(moves, key=lambda m: m.start):
            before = last.get(move.coordinate)
            if before and before.end > move.start:
                raise ScenarioError(
                    f"{self.where}: two moves of {move.coordinate} overlap at {move.start} s"
                )
            last[move.coordinate] = move


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
            raise ScenarioError(
                f"{file} line 1: column {', '.join(missing)} is missing; needed: "
                f"{','.join(CSV_REQUIRED)}"
            )
        joints = arm_coordinates(len(vehicle.joints))
        optional = [name for name in joints if name in columns]
        needed = f"{vehicle.name} has: {','.join(joints)}"
        if optional and len(optional) < len(joints):
            lacking = next(name for name in joints if name not in columns)
            raise ScenarioError(f"{file} line 1: {optional[0]} without {lacking}; {needed}")
        strange = [c for c in columns if c.startswith("alpha") and c not in joints]
        if strange:
            raise ScenarioError(f"{file} line 1: column {strange[0]}; {needed}")
        table = np.array(
            [
                _csv_row(file, line, row, (*CSV_REQUIRED, *optional))
                for line, row in enumerate(rows, start=2)
            ]
        )
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
