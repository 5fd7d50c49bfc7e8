"""The entry `trajectory` of the kind `end_effector`: what the hand does, and with which posture."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.arm.hand import (
    ELEVATION,
    HEADING,
    freedom,
    hands,
    jacobians,
    reach,
    stretch,
    working_posture,
)
from uam_control.coordinates import (
    ALPHA,
    ARM,
    CHI,
    PITCH,
    POSITION,
    YAW,
    arm_coordinates,
    coordinates,
)
from uam_control.mission.motion.flatness import Flyer
from uam_control.mission.motion.polynomials import Polynomials, joined
from uam_control.mission.scenarios.fitted_spline import CurveSamples, Misfit, fitted, with_pauses
from uam_control.mission.scenarios.hand_motion import (
    BEFORE,
    Task,
    Unreachable,
    following,
    holding,
    level_at_origin,
)
from uam_control.mission.scenarios.ramps import at_rest
from uam_control.mission.scenarios.reference_kinds import Middle, cut, keys_of, legs
from uam_control.mission.scenarios.route import Leg
from uam_control.mission.scenarios.scenario import LONGEST_FILE, ScenarioError, check_length
from uam_control.settings.csv_table import CsvTable
from uam_control.settings.section import Section
from uam_control.vehicle import VehicleDescription, VehicleError

KIND = "end_effector"
# shape → kind of the reference that it is
SHAPES = {
    "circle": "circle",
    "ellipse": "ellipse",
    "figure_eight": "lemniscate",
    "line": "waypoints",
}
HOLD, CSV = "hold", "csv"
OWN = ("kind", "shape", "elevation", "elevation_deg")
HOLD_KEYS = (*OWN, "position", "yaw_deg", "arm_deg", "base")
CSV_KEYS = (*OWN, "file", "arm_deg")
COLUMNS, LIFTED = ("t", "x", "y", "z", "yaw"), "elevation"
POSTURE = "posture"  # value of `elevation`: that of the posture, where the arm can keep it
SWING = 15.0  # [deg] of a joint without amplitude: that of the published tasks
FREE = math.radians(5.0)  # of a joint's range, beyond the swing, on both sides
LEVEL_AXIS = 0.5  # largest height of the axis of a joint that lifts the hand
TURNS = 0.05  # least singular value of a task that the arm has, and rate of elevation per joint
SINGULAR = 0.02  # least singular value of the hand's Jacobian per reach
PASSES = 1e-3  # [m, rad] of a curve through a file's rows
LOOKS = 0.1  # [s] between two checks of a posture


@dataclass(frozen=True, eq=False)
class HandSource:
    """A task of the hand, and what it is flown with."""

    where: str  # for errors
    task: Task
    ramp: float  # [s] of the task, at each end
    flyer: Flyer
    base: Polynomials | None = None  # its motion while the hand holds; None: as it needs it

    def slowed(self, factor: float) -> HandSource:
        """Return the task that takes `factor` times as long."""
        task = self.task._replace(path=self.task.path.slowed(factor))
        base = self.base and self.base.slowed(factor)
        return replace(self, task=task, ramp=factor * self.ramp, base=base)

    def legs(self) -> tuple[Leg, ...]:
        """Return the motion of base and arm; raise ScenarioError if there is none."""
        try:
            if self.base is None:
                motion = following(self.task, self.flyer)
            else:
                motion = holding(self.task, self.base, self.flyer)
                self._check_singular(motion)
        except Unreachable as error:
            raise ScenarioError(f"{self.where}: {error}{self._why()}") from None
        return cut(motion.shifted(-motion.knots[0]), BEFORE + self.ramp)

    def _check_singular(self, motion: Polynomials) -> None:
        """Raise Unreachable where the hand can hardly be moved in one of its directions."""
        times = np.arange(motion.knots[0], motion.knots[-1], LOOKS)
        chain, angles = self.flyer.chain, motion.rows(times, 1)[CHI, :, ARM]
        found = np.array([stretch(chain, one) for one in angles]) / reach(chain)
        least = found[:, freedom(chain) - 1]
        if least.min() < SINGULAR:
            at, worst = times[np.argmin(least)] - times[0], 100.0 * least.min()
            raise Unreachable(
                f"singular at {at:.1f} s: the hand moves by {worst:.1f} % of the arm's reach per "
                f"rad in its hardest direction, {100.0 * SINGULAR:g} % is the least allowed"
            )

    def _why(self) -> str:
        """Return what to do about a task that is not met, for the end of the text."""
        if self.base is None:
            return "; a slower task, or a calmer posture, helps"
        chain, task = self.flyer.chain, self.task.path.first
        times = np.arange(self.base.knots[0], self.base.knots[-1], LOOKS)
        shoulders = self.base.rows(times, 1)[CHI, :, POSITION] + chain.offsets[0]
        away = np.linalg.norm(task[POSITION] - shoulders, axis=1).max()
        if away < reach(chain):
            return "; a smaller motion of the base, or another arm_deg, helps"
        return (
            f"; the arm reaches {reach(chain):.2f} m from its first joint, up to {away:.2f} m "
            "needed"
        )


def hand_source(entry: Section, vehicle: VehicleDescription, folder: Path) -> HandSource:
    """Return the task of an `end_effector` entry; folder: of its CSV file; raise ScenarioError."""
    if "at" in entry.values:
        raise entry.error("at", f"not with the kind {KIND}")
    shape = entry.one_of("shape", (*SHAPES, HOLD, CSV))
    try:
        read = _Reader(entry, Flyer.of(vehicle), vehicle)
    except VehicleError as error:
        raise entry.error("kind", str(error)) from None
    if shape == HOLD:
        return read.hold()
    return read.file(folder) if shape == CSV else read.curve(SHAPES[shape])


class _Reader:
    """Reads an entry for one vehicle."""

    def __init__(self, entry: Section, flyer: Flyer, vehicle: VehicleDescription) -> None:
        self._entry, self._flyer, self._vehicle = entry, flyer, vehicle
        self._names = arm_coordinates(len(vehicle.joints))
        self._ranges = tuple((joint.low, joint.high) for joint in vehicle.joints)

    def curve(self, kind: str) -> HandSource:
        """Return a task along a curve or line of another kind."""
        self._entry.only([*OWN, *(key for key in keys_of(kind) if key not in ("kind", "at"))])
        values = {key: one for key, one in self._entry.values.items() if key not in OWN}
        sweeps = [self._sweep(one) for one in self._entry.entries("sweep", True)]
        swing = max((abs(one["amplitude_deg"]) for one in sweeps), default=0.0)
        posture = self._posture(math.radians(swing))
        filled = {"kind": kind, **values, "arm_deg": np.degrees(posture).tolist()}
        if sweeps:
            filled["sweep"] = sweeps
        parts = legs(self._entry.like(filled), self._middle(posture))
        swung = {self._names.index(one["joint"]) for one in sweeps}
        path = joined([part.path for part in parts])
        ramp = parts[0].path.length if len(parts) > 1 else 0.0
        return self._source(path, posture, ramp, swung)

    def hold(self) -> HandSource:
        """Return the task of a hand that stays, while the base flies a path of its own."""
        entry = self._entry
        entry.only(HOLD_KEYS)
        posture, middle = self._posture(0.0), np.zeros(ALPHA + len(self._names))
        middle[POSITION] = entry.numbers("position", 3)
        middle[YAW] = math.radians(entry.number("yaw_deg", default=0.0))
        middle[ARM] = posture
        own = entry.section("base")
        flown = {"height": 1.0, "kind": own.text("kind"), **own.values}
        for key in ("height", "centre", "yaw", "yaw_deg", "yaw_turns", "arm_deg", "sweep", "at"):
            if key in own.values:
                raise own.error(key, "not of a base whose hand holds: the hand says where it is")
        parts = legs(own.like(flown), self._middle(posture))
        curve = joined([part.path for part in parts])
        above = np.zeros_like(middle)
        above[POSITION] = middle[POSITION] - (0.0, 0.0, 1.0)
        turned = level_at_origin(middle[None])
        turned[:, YAW] -= hands(self._flyer.chain, turned)[0, HEADING] - middle[YAW]
        above[POSITION] -= hands(self._flyer.chain, turned)[0, POSITION]
        base = curve.shifted(0.0, above)
        still = np.zeros((len(curve.knots) - 1, 1, len(middle)))
        still[:, 0] = middle
        ramp = parts[0].path.length if len(parts) > 1 else 0.0
        source = self._source(Polynomials(curve.knots, still), posture, ramp, set(), held=True)
        return replace(source, base=base)

    def file(self, folder: Path) -> HandSource:
        """Return the task of a CSV file; see docs/scenarios.md."""
        entry = self._entry
        entry.only(CSV_KEYS)
        table = CsvTable(folder / entry.text("file"), ScenarioError)
        allowed = (*COLUMNS, *[LIFTED] * (LIFTED in table.header))
        if sorted(table.header) != sorted(allowed):
            expected = f"columns {','.join(COLUMNS)} expected, and {LIFTED} if it is a task"
            raise table.error(table.header_line, f"{','.join(table.header)}: {expected}")
        numbers = np.array(table.numbers(allowed))
        if len(numbers) < 2 or np.any(np.diff(numbers[:, 0]) <= 0.0):
            raise ScenarioError(f"{table.file}: column t: two or more increasing times expected")
        posture = self._posture(0.0)
        check_length(numbers[-1, 0] - numbers[0, 0], f"{table.file}: column t", LONGEST_FILE)
        numbers, of = with_pauses(numbers, 0, range(1, len(allowed)))
        times = numbers[:, 0] - numbers[0, 0]
        values = np.zeros((len(times), ALPHA + len(posture)))
        values[:, POSITION], values[:, YAW] = numbers[:, 1:4], np.unwrap(numbers[:, 4])
        values[:, ARM] = posture
        if LIFTED in table.header:
            values[:, PITCH] = numbers[:, 5]
        try:
            (path,) = fitted(times, [CurveSamples(values)], PASSES)
        except Misfit as error:
            text = f"no smooth curve passes within {PASSES:g}, it is {error.distance:.3g} off"
            raise table.error(table.lines[of[error.row]], text) from None
        if not all(at_rest(rows) for rows in path.ends()):
            raise ScenarioError(f"{table.file}: the hand must be at rest in the first and last row")
        return self._source(path, posture, 0.0, set(), lifted=LIFTED in table.header)

    def _source(
        self,
        path: Polynomials,
        posture: np.ndarray,
        ramp: float,
        swung: set[int],
        held: bool = False,
        lifted: bool = False,
    ) -> HandSource:
        """Return the task along a path; held: the base has its own; lifted: it has elevations."""
        moves = tuple(i for i in range(len(posture)) if i not in swung)
        chi = np.zeros(ALPHA + len(posture))
        chi[ARM], chi[YAW] = posture, path.first[YAW]
        columns = [ALPHA + i for i in moves]
        headed = not held or self._has(chi, [*range(3), HEADING], [YAW, *columns])
        rows = [*range(3), *[HEADING] * headed, ELEVATION] if held else [ELEVATION]
        can = self._has(chi, rows, [YAW, *columns] if held else columns)
        elevation = self._elevation(chi)
        asked = lifted or "elevation_deg" in self._entry.values
        if asked and not can:
            raise self._entry.error(
                "file" if lifted else "elevation_deg",
                f"the arm of {self._vehicle.name} cannot keep an elevation beside this task",
            )
        if elevation is not None and not lifted:
            value = np.zeros(len(chi))
            value[PITCH] = elevation
            path = path.shifted(0.0, value)
        elevated = can and (lifted or elevation is not None)
        return HandSource(self._entry.where, Task(path, elevated, headed, moves), ramp, self._flyer)

    def _has(self, chi: np.ndarray, rows: list[int], columns: list[int]) -> bool:
        """Return whether `columns` of chi (6 + n,) can change each of `rows` of the hand."""
        if len(columns) < len(rows):
            return False
        slopes = jacobians(self._flyer.chain, level_at_origin(chi[None]), columns)[0, rows]
        return bool(np.linalg.svd(slopes, compute_uv=False)[len(rows) - 1] > TURNS)

    def _elevation(self, chi: np.ndarray) -> float | None:
        """Return the elevation [rad] that is kept, None for none."""
        entry = self._entry
        if entry.has("elevation_deg"):
            return math.radians(entry.number("elevation_deg"))
        if entry.has("elevation") and entry.one_of("elevation", (POSTURE,)):
            return float(hands(self._flyer.chain, level_at_origin(chi[None]))[0, ELEVATION])
        return None

    def _posture(self, swing: float) -> np.ndarray:
        """Return `arm_deg` [rad], or a posture in which every joint has room for `swing` [rad]."""
        if "arm_deg" in self._entry.values:
            return np.radians(self._entry.numbers("arm_deg", len(self._names)))
        rooms = []
        for low, high in self._ranges:  # about zero; of a joint without room there, its middle
            middle = 0.0 if min(-low, high) > swing + FREE else (low + high) / 2.0
            half = max(0.0, min(middle - low, high - middle) - swing - FREE)
            rooms.append((middle - half, middle + half))
        low, high = self._flyer.hinge
        hinge = low + swing + FREE, high - swing - FREE
        return working_posture(self._flyer.chain, self._vehicle.stowed, *np.array(rooms).T, hinge)

    def _sweep(self, one: Section) -> dict[str, Any]:
        """Return a swing with joint and amplitude; default: the first joint that lifts the hand."""
        lifts = next(
            (i for i, axis in enumerate(self._flyer.chain.axes) if abs(axis[2]) < LEVEL_AXIS), 0
        )
        joint = one.one_of("joint", self._names, default=self._names[lifts])
        amplitude = one.number("amplitude_deg", default=SWING)
        return {**one.values, "joint": joint, "amplitude_deg": amplitude}

    def _middle(self, posture: np.ndarray) -> Middle:
        chi = np.zeros(len(coordinates(len(posture))))
        chi[ARM] = posture
        return Middle(chi, self._ranges)
