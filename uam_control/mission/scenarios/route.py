"""From take-off to a trajectory and back: phases of their own, with bounded speed.

take-off   vertically, to the height of the trajectory's first point
transit    to that point, with yaw and arm
run-up     if the trajectory begins with a speed: from rest to its first value, rate, ...
trajectory
run-out    if it ends with a speed: to rest
return     to the take-off point; or only `stow`, the arm to its angles of the take-off
land
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ARM, CHI_DDOT, CHI_DOT, POSITION, YAW, Z
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.motion.polynomials import (
    PEAK_ACCELERATION,
    PEAK_RATE,
    Polynomials,
    joined,
    ramp_up,
    rest_to_rest,
    reversed_in_time,
)
from uam_control.mission.scenarios.scenario_options import RETURN, ScenarioOptions
from uam_control.vehicle import GRAVITY

TAKEOFF, LANDING = 3.0, 5.0  # [s] shortest
SHORTEST = 1.0  # [s] of another part
PER_SECOND = 10  # lengths are whole tenths, so that a millimetre at the start changes none
NEAR, NEAR_ANGLE = 0.05, 0.05  # [m], [rad] that need no transit
PAUSE = 1.0  # [s] at rest before the descent
SINK = 0.03  # [m] depth of the landing reference below the ground, for a firm contact
JERK = 3  # row
AT_REST = (0.0, 0.005, 0.02, 0.2, 2.0)  # rates, accelerations, ... that count as zero
RAMP_LENGTHS = 5, 150  # [s / PER_SECOND]
MARGIN = 1.25  # acceleration, jerk and snap in a run-up / at the trajectory's begin
RAMP_LIMITS = (1.0, 4.0, 16.0)  # acceleration, jerk [1/s] and snap [1/s^2] / transit_acceleration
HARDER = (3.0, 7.0, 7.0)  # times these in a ramp that would leave the room
ROUNDING, SHARPER = 1.001, 1.5  # of acceleration, and of jerk and snap / the trajectory's own
ROOM, LOWEST = 1.0, 0.6  # [m] of a ramp around the trajectory; height where the trajectory is above
TURN_PER_WAY = 3.0  # [rad/m] the same of yaw and joints / of the position
RUN_UP, TRAJECTORY, RUN_OUT = "run-up", "trajectory", "run-out"


class Leg(NamedTuple):
    """A part of a flight with its own phase."""

    phase: str
    path: Polynomials


@dataclass(frozen=True)
class Route:
    """A trajectory, from rest to rest. legs: run-up, trajectory, run-out; ends: RETURN or LAND."""

    legs: tuple[Leg, ...]
    ends: str
    options: ScenarioOptions

    @property
    def path(self) -> Polynomials:
        """Return the legs as one curve."""
        return joined([leg.path for leg in self.legs])

    def slowed(self, factor: float) -> Route:
        """Return the route with legs that take `factor` times as long."""
        return replace(
            self, legs=tuple(Leg(leg.phase, leg.path.slowed(factor)) for leg in self.legs)
        )

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


def with_ramps(path: Polynomials, options: ScenarioOptions) -> tuple[Leg, ...]:
    """Return `path` as the trajectory, with a run-up and a run-out where it is not at rest."""
    begin, end = path.ends()
    legs, beside = [Leg(TRAJECTORY, path)], _Needs.of(path, options)
    if not _at_rest(begin):
        legs.insert(0, Leg(RUN_UP, beside.ramp(begin)))
    if not _at_rest(end):
        end[[CHI_DOT, JERK]] *= -1.0  # flown backwards in time
        legs.append(Leg(RUN_OUT, reversed_in_time(beside.ramp(end))))
    return tuple(legs)


def _at_rest(rows: np.ndarray) -> bool:
    return all(np.abs(row).max() <= limit for row, limit in zip(rows[1:], AT_REST[1:], strict=True))


class _Needs(NamedTuple):
    """What a trajectory needs, so that a ramp to it needs no more.

    limits (2, 3): acceleration, jerk and snap of the position, and of yaw and joints; force, tilt:
    the largest [m/s^2 per mass, rad]; low, high (3,): the room [m]; least (2, 3): gentle limits.
    """

    limits: np.ndarray
    force: float
    tilt: float
    low: np.ndarray
    high: np.ndarray
    least: np.ndarray

    @classmethod
    def of(cls, path: Polynomials, options: ScenarioOptions) -> _Needs:
        """Return the needs of a trajectory, at least those of `options`."""
        rows = _inside(path, max(200, 4 * len(path.knots)))
        least = np.array([options.transit_acceleration * factor for factor in RAMP_LIMITS])
        least = np.stack([least, least * TURN_PER_WAY])
        own = _sizes(rows).max(axis=0)[:, CHI_DDOT:] * (ROUNDING, SHARPER, SHARPER)
        limits, (force, tilt) = np.maximum(own, least * HARDER), _force_and_tilt(rows)
        hardest = HARDER[0] * options.transit_acceleration
        low, high = rows[:, 0, POSITION].min(axis=0), rows[:, 0, POSITION].max(axis=0)
        ground = min(low[Z], LOWEST)
        low, high = low - ROOM, high + ROOM
        low[Z] = max(low[Z], ground)
        force = max(ROUNDING * float(force.max()), GRAVITY + hardest)
        tilt = max(ROUNDING * float(tilt.max()), math.atan(hardest / GRAVITY))
        return cls(limits, force, tilt, low, high, least)

    def ramp(self, goal: np.ndarray) -> Polynomials:
        """Return the run-up to goal (5, 6 + n) that needs no more than the trajectory.

        The shortest gentle one within the room; else the gentlest there; else the one that leaves
        the room least. If each needs more than the trajectory: the one with the least need.
        """
        gentle = np.maximum(_sizes(goal[None]).max(axis=0)[:, CHI_DDOT:] * MARGIN, self.least)
        best, least = None, (math.inf,) * 3
        for tenths in range(*RAMP_LENGTHS):
            ramp = ramp_up(goal, tenths / PER_SECOND)
            rows = _inside(ramp, 60)
            sizes, (force, tilt) = _sizes(rows)[:, :, CHI_DDOT:], _force_and_tilt(rows)
            needs = (sizes / self.limits).max(), force.max() / self.force, tilt.max() / self.tilt
            places = rows[:, 0, POSITION]
            outside = max(0.0, float(np.maximum(self.low - places, places - self.high).max()))
            rank = (max(1.0, *needs), outside, max(1.0, float((sizes / gentle).max())))
            if rank < least:
                best, least = ramp, rank
            if rank == (1.0, 0.0, 1.0):
                break
        return best


def _inside(path: Polynomials, count: int) -> np.ndarray:
    """Return rows (count, 5, 6 + n) from just after the begin of a path to just before its end."""
    first, last = path.knots[0] + 1e-6, path.knots[-1] - 1e-6
    return path.rows(np.linspace(first, last, count)).swapaxes(0, 1)


def _force_and_tilt(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the force per mass (m,) [m/s^2] and the tilt (m,) [rad] that rows (m, 5, 6 + n) need.

    Without drag.
    """
    push = rows[:, CHI_DDOT, POSITION] + (0.0, 0.0, GRAVITY)
    force = np.linalg.norm(push, axis=1)
    return force, np.arccos(np.clip(push[:, Z] / np.maximum(force, 1e-9), -1.0, 1.0))


def _sizes(rows: np.ndarray) -> np.ndarray:
    """Return norms of the position's rows, and the largest of yaw and joints: (m, 2, 5).

    rows (m, 5, 6 + n).
    """
    ways = np.linalg.norm(rows[:, :, POSITION], axis=2)
    return np.stack([ways, np.abs(rows[:, :, YAW:]).max(axis=2)], axis=1)
