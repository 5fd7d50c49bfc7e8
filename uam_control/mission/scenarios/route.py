"""From take-off to a trajectory and back: phases of their own, with bounded speed.

The phases: docs/scenarios.md, *Ways there and back*; where only the arm goes back, `stow`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from uam_control.coordinates import ARM, CHI_DOT, JERK, POSITION, YAW, Z
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.motion.polynomials import (
    PEAK_ACCELERATION,
    PEAK_RATE,
    Polynomials,
    joined,
    rest_to_rest,
    reversed_in_time,
)
from uam_control.mission.scenarios.ramps import PER_SECOND, Needs, at_rest
from uam_control.mission.scenarios.scenario_options import RETURN, ScenarioOptions

TAKEOFF, LANDING = 3.0, 5.0  # [s] shortest
SHORTEST = 1.0  # [s] of another part
NEAR, NEAR_ANGLE = 0.05, 0.05  # [m], [rad] that need no transit
PAUSE = 1.0  # [s] at rest before the descent
SINK = 0.03  # [m] depth of the landing reference below the ground, for a firm contact
RUN_UP, TRAJECTORY, RUN_OUT = "run-up", "trajectory", "run-out"


class Leg(NamedTuple):
    """A part of a flight with its own phase."""

    phase: str
    path: Polynomials


# returns the run-up to value, rate, ... (ROWS, 6 + n), None if there is none
Ramp = Callable[[np.ndarray], Polynomials | None]


class Source(Protocol):
    """What legs are made of, where they are not as they were when it is slower."""

    def slowed(self, factor: float) -> Source:
        """Return it `factor` times as slow."""

    def legs(self) -> tuple[Leg, ...]:
        """Return its legs."""


@dataclass(frozen=True)
class Route:
    """A trajectory, from rest to rest."""

    legs: tuple[Leg, ...]  # run-up, trajectory, run-out
    ends: str  # RETURN or LAND
    options: ScenarioOptions
    ramps_chosen: bool = False  # run-up and run-out are no part of the trajectory, others may be
    source: Source | None = None  # of the legs; None: they are slowed down as they are

    @classmethod
    def around(cls, path: Polynomials, ends: str, options: ScenarioOptions) -> Route:
        """Return the route along a trajectory that need not begin and end at rest."""
        ramp = Needs.of(path, options).ramp
        legs = _ramp(path, RUN_UP, ramp), Leg(TRAJECTORY, path), _ramp(path, RUN_OUT, ramp)
        return cls(tuple(leg for leg in legs if leg), ends, options, True)

    @property
    def path(self) -> Polynomials:
        """Return the legs as one curve."""
        return joined([leg.path for leg in self.legs])

    def slowed(self, factor: float) -> Route:
        """Return the route whose legs take `factor` times as long; for chosen ramps new ones."""
        if self.ramps_chosen:
            return Route.around(self.trajectory.slowed(factor), self.ends, self.options)
        if self.source is not None:
            source = self.source.slowed(factor)
            return replace(self, legs=source.legs(), source=source)
        return replace(
            self, legs=tuple(Leg(leg.phase, leg.path.slowed(factor)) for leg in self.legs)
        )

    @property
    def trajectory(self) -> Polynomials:
        """Return the part without run-up and run-out."""
        return next(leg.path for leg in self.legs if leg.phase == TRAJECTORY)

    def with_ramps(self, phases: Collection[str], ramp: Ramp) -> Route:
        """Return the route with other ramps in `phases`, where there are some."""
        trajectory = self.trajectory
        legs = (
            (leg.phase in phases and _ramp(trajectory, leg.phase, ramp)) or leg for leg in self.legs
        )
        return replace(self, legs=tuple(legs))

    def flight(self, start: np.ndarray) -> tuple[Leg, ...]:
        """Return all parts of the flight from chi (6 + n,) at take-off; the arm is at its angles
        for take-off and landing there."""
        options, first = self.options, self.legs[0].path.first
        turns = start[YAW] + wrap_angle(first[YAW] - start[YAW]) - first[YAW]
        offset = np.zeros_like(start)
        offset[YAW] = turns
        legs = [leg._replace(path=leg.path.shifted(0.0, offset)) for leg in self.legs]
        begin, above = legs[0].path.first, start.copy()
        above[Z] = begin[Z]
        if _near(above, begin):
            above = begin
        before = [_move("take-off", start, above, options, TAKEOFF)]
        if not np.array_equal(above, begin):
            before.append(_move("transit", above, begin, options, SHORTEST))
        end = legs[-1].path.last
        home = end.copy()
        home[ARM] = start[ARM]
        if self.ends == RETURN:
            home[:Z] = start[:Z]
        after = []
        if not _near(end, home, 1e-3):
            name = "return" if self.ends == RETURN else "stow"
            after.append(_move(name, end, home, options, SHORTEST))
        else:
            home = end
        down = home.copy()
        down[Z] = start[Z] - SINK
        wait = rest_to_rest(home, home, PAUSE)
        slow = replace(options, transit_speed=max(0.05, options.transit_speed / 2.0))
        descent = _move("land", home, down, slow, LANDING).path
        after.append(Leg("land", joined([wait, descent])))
        return (*before, *legs, *after)


def _near(a: np.ndarray, b: np.ndarray, limit: float = NEAR) -> bool:
    """Return whether no motion is needed between a and b (6 + n,)."""
    apart = np.abs(b - a)
    return bool(
        np.linalg.norm(apart[POSITION]) <= limit and apart[YAW:].max() <= limit / NEAR * NEAR_ANGLE
    )


def _move(
    phase: str, start: np.ndarray, goal: np.ndarray, options: ScenarioOptions, shortest: float
) -> Leg:
    """Return the move from start to goal (6 + n,), within the limits of `options`."""
    way = float(np.linalg.norm(goal[POSITION] - start[POSITION]))
    turn = abs(float(goal[YAW] - start[YAW]))
    swing = float(np.abs(goal[ARM] - start[ARM]).max(initial=0.0))
    length = max(
        shortest,
        PEAK_RATE * way / options.transit_speed,
        math.sqrt(PEAK_ACCELERATION * way / options.transit_acceleration),
        PEAK_RATE * turn / options.transit_yaw_rate,
        PEAK_RATE * swing / options.transit_joint_rate,
    )
    return Leg(phase, rest_to_rest(start, goal, math.ceil(length * PER_SECOND - 1e-6) / PER_SECOND))


def _ramp(path: Polynomials, phase: str, ramp: Ramp) -> Leg | None:
    """Return the run-up or run-out of a trajectory; None if it is at rest there, or has none."""
    rows = path.ends()[phase == RUN_OUT]
    if at_rest(rows):
        return None
    if phase == RUN_OUT:
        rows[[CHI_DOT, JERK]] *= -1.0  # flown backwards in time
    found = ramp(rows)
    if found is None:
        return None
    return Leg(phase, reversed_in_time(found) if phase == RUN_OUT else found)
