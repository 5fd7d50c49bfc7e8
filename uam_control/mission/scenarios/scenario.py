"""Scenarios: what a flight does, in mission time."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from uam_control.coordinates import CHI, Z, coordinates
from uam_control.grasp.windows import Approach
from uam_control.mission.motion.polynomials import Polynomials, joined
from uam_control.mission.motion.trajectory import Move, Moves, Trajectory
from uam_control.mission.scenarios.route import PAUSE, SINK, TRAJECTORY, Route
from uam_control.mission.scenarios.scenario_options import LAND

LONGEST = 86400.0  # [s] of a flight: more than that are times in another unit
LONGEST_FILE = 3600.0  # [s] of a planner's trajectory: longer than a battery lasts
STANDING = 0.285  # [m] height of the origin on the ground, before the take-off has measured it


class ScenarioError(ValueError):
    """An invalid scenario; the text is one line: where, what is wrong, what is allowed."""


def check_length(length: float, where: str, longest: float = LONGEST) -> None:
    """Raise ScenarioError for a length [s] above `longest`; before arrays of it are made."""
    if length > longest:
        raise ScenarioError(
            f"{where}: {length:.6g} s, or {length / 3600.0:.3g} h, is too long: {longest:g} s is "
            "possible; give times in seconds"
        )


@dataclass(frozen=True)
class Landing:
    """Descent from mission time `at` [s] for `duration` [s], to the height of the take-off."""

    at: float
    duration: float

    @property
    def half(self) -> float:
        """Mission time [s] from which on a touchdown is one."""
        return self.at + 0.5 * self.duration

    @property
    def end(self) -> float:
        """Mission time [s]."""
        return self.at + self.duration


@dataclass(frozen=True)
class Grip:
    """Pick and drop along a trajectory, in its own time [s]."""

    switches: tuple[tuple[float, bool], ...]  # (begin, on) of the magnet
    rests: tuple[Move, ...]  # between rests of its coordinates

    def timed(self, begin: float = 0.0, factor: float = 1.0) -> Grip:
        """Return the grip `factor` times as slow, in a time that is `begin` [s] at the begin."""
        ends = ((begin + factor * m.start, begin + factor * m.end) for m in self.rests)
        moves = (replace(m, start=a, end=b) for m, (a, b) in zip(self.rests, ends, strict=True))
        return Grip(tuple((begin + factor * at, on) for at, on in self.switches), tuple(moves))


@dataclass(frozen=True)
class Scenario:
    """A flight: moves, a route, or both; phases, magnet switching, landing.

    Times are mission times [s]; phases, magnet, snapshots: (begin, value). A route without route_at
    is the whole flight, see `route`; with it, its motion is added to the moves' from then on.
    """

    name: str
    description: str
    arm_start: tuple[float, ...]  # joint angles at take-off [rad]
    phases: tuple[tuple[float, str], ...]
    landing: Landing
    moves: tuple[Move, ...] = ()
    route: Route | None = None
    route_at: float | None = None
    magnet: tuple[tuple[float, bool], ...] = ()
    payload_mass: float = 0.0  # [kg]
    drop_point: tuple[float, float] | None = None  # x, y [m]
    snapshots: tuple[tuple[float, str], ...] = field(default=())
    faults: tuple[object, ...] = ()  # unchecked entries, see uam_sim_bridge.faults
    notes: tuple[str, ...] = ()  # for the user, about the file
    environment: tuple[dict[str, Any], ...] | None = None  # in simulation; None: the usual
    grip: Grip | None = None  # along a route that is the whole flight
    approaches: tuple[tuple[float, Approach], ...] = ()  # by the time of a grip; else from above

    @property
    def surroundings(self) -> dict[str, Any]:
        """Return the change of the plant's numbers that this scenario makes."""
        return {} if self.environment is None else {"environment": list(self.environment)}

    @property
    def motions(self) -> tuple[Move, ...]:
        """Return the moves from rest to rest, also those along a route with a grip."""
        return self.moves if self.grip is None else self.grip.timed(self.trajectory_begins).rests

    @property
    def trajectory_begins(self) -> float:
        """Mission time [s] at which the trajectory of a route begins."""
        return next(at for at, name in self.phases if name == TRAJECTORY)

    def trajectory(self, start: np.ndarray) -> Trajectory:
        """Return the reference from `start` (chi at take-off) to the landing point."""
        if self.route is not None and self.route_at is None:
            return joined([leg.path for leg in self.route.flight(start)])
        begin, length = self.landing.at, self.landing.duration
        moves = Moves(start, [*self.moves, Move("z", begin, begin + length, start[Z] - SINK)])
        if self.route is None:
            return moves
        return Added(moves, self.route.path.shifted(self.route_at))

    def begun_at(self, start: np.ndarray) -> Scenario:
        """Return the scenario with the phases and the landing of a take-off at chi (6 + n,)."""
        if self.route is None or self.route_at is not None:
            return self
        legs = self.route.flight(start)
        begins = np.append(0.0, np.cumsum([leg.path.length for leg in legs])).tolist()
        phases = tuple((begin, leg.phase) for begin, leg in zip(begins, legs, strict=False))
        landing = Landing(begins[-2] + PAUSE, begins[-1] - begins[-2] - PAUSE)
        found = replace(self, phases=phases, landing=landing)
        if self.grip is None:
            return found
        return replace(found, magnet=self.grip.timed(found.trajectory_begins).switches)

    def from_origin(self) -> tuple[Scenario, Trajectory]:
        """Return scenario and reference of a take-off at the origin, with the arm of its start."""
        start = standing(self.arm_start)
        begun = self.begun_at(start)
        return begun, begun.trajectory(start)

    def along(self, route: Route) -> Scenario:
        """Return the flight along another route."""
        return replace(self, route=route).begun_at(standing(self.arm_start))

    def slowed(self, factor: float) -> Scenario:
        """Return the scenario that takes `factor` times as long.

        Of a flight along a route alone, take-off, transit, return and landing keep their lengths,
        and ramps that are not part of the trajectory are chosen anew.
        """
        if factor == 1.0:
            return self
        route = self.route and self.route.slowed(factor)
        if route is not None and self.route_at is None:
            slower = self.grip and self.grip.timed(factor=factor)
            return replace(self, grip=slower).along(route)

        def later(pairs: tuple) -> tuple:
            return tuple((factor * time, value) for time, value in pairs)

        return replace(
            self,
            phases=later(self.phases),
            landing=Landing(factor * self.landing.at, factor * self.landing.duration),
            moves=tuple(
                replace(move, start=factor * move.start, end=factor * move.end)
                for move in self.moves
            ),
            route=route,
            route_at=None if self.route_at is None else factor * self.route_at,
            magnet=later(self.magnet),
            approaches=later(self.approaches),
            snapshots=later(self.snapshots),
        )

    @property
    def landing_point(self) -> tuple[float, float] | None:
        """Where it lands: x, y [m, world]; None: at the take-off point."""
        if self.route is not None and self.route_at is None:
            x, y = self.route.path.last[:Z]
            return (float(x), float(y)) if self.route.ends == LAND else None
        found = {move.coordinate: move.to for move in sorted(self.moves, key=lambda m: m.start)}
        return (found["x"], found["y"]) if {"x", "y"} <= found.keys() else None

    @property
    def phase_names(self) -> tuple[str, ...]:
        """Return the names of the phases, each once, in order."""
        return tuple(dict.fromkeys(name for _, name in self.phases))

    def phase(self, time: float) -> str:
        """Return the name of the phase at mission time `time` [s] >= 0."""
        for start, name in reversed(self.phases):
            if time >= start:
                return name
        raise ValueError(f"no phase at {time} s")

    def magnet_on(self, time: float) -> bool:
        """Return the desired state of the magnet at mission time `time` [s]."""
        return next((on for at, on in reversed(self.magnet) if time >= at), False)


class Added:
    """Moves, and the motion of a curve from its first value on."""

    def __init__(self, moves: Moves, curve: Polynomials) -> None:
        """moves, curve: of mission time, with the same coordinates."""
        self._moves, self._curve, self._first = moves, curve, curve.first
        self._offset = np.empty((0, 0))

    def write(self, time: float, motion: np.ndarray) -> None:
        """Write the motion (5, 6 + n); see `Trajectory.write`."""
        if self._offset.shape != motion.shape:
            self._offset = np.empty_like(motion)
        self._moves.write(time, motion)
        self._curve.write(time, self._offset)
        motion += self._offset
        motion[CHI] -= self._first

    def rows(self, times: np.ndarray, count: int) -> np.ndarray:
        """Return the first `count` rows (count, m, 6 + n) at times (m,) [s]."""
        found = self._moves.rows(times, count) + self._curve.rows(times, count)
        found[CHI] -= self._first
        return found


def standing(arm_start: tuple[float, ...]) -> np.ndarray:
    """Return chi (6 + n,) of a vehicle that stands at the origin, for plans before the take-off."""
    chi = np.zeros(len(coordinates(len(arm_start))))
    chi[Z] = STANDING
    chi[len(chi) - len(arm_start) :] = arm_start
    return chi
