"""Scenarios, read from YAML files (config/scenarios) or CSV trajectories."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.coordinates import ARM, COORDINATES
from uam_control.mission.trajectory import Chain, Move, Moves, Sampled, Trajectory
from uam_control.settings import configuration, yaml_file

ANGLES = COORDINATES[3:]
CSV_REQUIRED = ("t", "px", "py", "pz", "yaw", "vx", "vy", "vz", "ax", "ay", "az", "dyaw")
CSV_OPTIONAL = ("alpha_1", "alpha_2")
JOINT_LIMIT = math.radians(110.0)


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
    arm_start: tuple[float, float]
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
            for name, value in zip(COORDINATES, self.samples.first, strict=True)
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
        return next(name for start, name in reversed(self.phases) if time >= start)

    def magnet_on(self, time: float) -> bool:
        """Return the desired state of the magnet at mission time `time` [s]."""
        return next((on for at, on in reversed(self.magnet) if time >= at), False)


SINK = 0.03  # m, depth of the landing reference below the ground, for a firm contact


def load_scenario(name_or_file: str) -> Scenario:
    """Return a scenario by its name in config/scenarios, or of a .yaml or .csv file.

    Raises ScenarioError.
    """
    file = Path(name_or_file)
    if file.suffix not in (".yaml", ".csv"):
        try:
            file = configuration.path(f"scenarios/{name_or_file}.yaml")
        except configuration.ConfigurationError as error:
            raise ScenarioError(str(error)) from None
    try:
        return from_csv(file) if file.suffix == ".csv" else from_yaml(file)
    except OSError as error:
        raise ScenarioError(f"{file}: {error.strerror}") from None


def from_yaml(file: Path) -> Scenario:
    """Return the scenario of a YAML file; form: config/scenarios/pick_and_place.yaml."""
    document = yaml_file.read(file, ScenarioError)
    if not isinstance(document, dict):
        raise ScenarioError(f"{file}: a mapping expected, see scenarios/pick_and_place.yaml")
    reader = Reader(str(file))
    arm = reader.mapping(document, "arm_start")
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
        arm_start=(
            math.radians(reader.number(arm, "alpha_1_deg", "arm_start")),
            math.radians(reader.number(arm, "alpha_2_deg", "arm_start")),
        ),
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

    def __init__(self, where: str) -> None:
        self.where = where

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
        allowed = [c for c in COORDINATES if c not in ("roll", "pitch")]
        if coordinate not in allowed:
            raise ScenarioError(
                f"{self.where}: '{owner}.coordinate' is {coordinate!r}, "
                f"allowed: {', '.join(allowed)}"
            )
        angle = coordinate in ANGLES
        target = self.number(entry, "to_deg" if angle else "to", owner)
        start, end = self.number(entry, "from", owner), self.number(entry, "until", owner)
        if end <= start:
            raise ScenarioError(f"{self.where}: '{owner}' ends at {end} s, before it begins")
        return Move(coordinate, start, end, math.radians(target) if angle else target)

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


def from_csv(file: Path, takeoff: float = 3.0, landing: float = 5.0) -> Scenario:
    """Return the scenario of a CSV trajectory: columns CSV_REQUIRED and CSV_OPTIONAL (SI, ENU).

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
        optional = [name for name in CSV_OPTIONAL if name in columns]
        if len(optional) == 1:
            raise ScenarioError(
                f"{file} line 1: {optional[0]} without its twin; the arm has two "
                "joints: alpha_1,alpha_2"
            )
        unknown = [c for c in columns if c.startswith("alpha") and c not in CSV_OPTIONAL]
        if unknown:
            raise ScenarioError(
                f"{file} line 1: column {unknown[0]}: the arm has two joints: alpha_1,alpha_2"
            )
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
    samples = np.zeros((len(table), 3, 8))
    for row, first in enumerate((1, 5, 8)):
        samples[:, row, 0:3] = table[:, first : first + 3]
    samples[:, 0, 5] = table[:, 4]
    samples[:, 1, 5] = table[:, 11]
    samples[:, 2, 5] = np.gradient(table[:, 11], times)
    arm_start = (0.0, math.pi / 2.0)
    samples[:, 0, ARM] = arm_start
    if optional:
        samples[:, 0, ARM] = table[:, 12:14]
        if np.any(np.abs(table[:, 12:14]) > JOINT_LIMIT):
            line = int(np.argmax(np.any(np.abs(table[:, 12:14]) > JOINT_LIMIT, axis=1))) + 2
            raise ScenarioError(f"{file} line {line}: joint angle beyond ±{JOINT_LIMIT:.2f} rad")
        for row in (1, 2):
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
