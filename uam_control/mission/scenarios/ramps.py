"""Run-ups to a trajectory that begins with a speed: from rest to its first value, rate, ...

A run-out is one that is flown backwards in time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import CHI_DDOT, POSITION, YAW, Z
from uam_control.mission.motion.polynomials import Polynomials, added, ramp_up
from uam_control.mission.scenarios.scenario_options import ScenarioOptions
from uam_control.vehicle import GRAVITY

PER_SECOND = 10  # lengths are whole tenths, so that a millimetre at the start changes none
AT_REST = (0.0, 0.005, 0.02, 0.2, 2.0)  # rates, accelerations, ... that count as zero
RAMP_LENGTHS = 5, 150  # [s / PER_SECOND]
MARGIN = 1.25  # acceleration, jerk and snap in a run-up / at the trajectory's begin
RAMP_LIMITS = (1.0, 4.0, 16.0)  # acceleration, jerk [1/s] and snap [1/s^2] / transit_acceleration
HARDER = (3.0, 7.0, 7.0)  # times these in a ramp that would leave the room
ROUNDING, SHARPER = 1.001, 1.5  # of acceleration, and of jerk and snap / the trajectory's own
ROOM, LOWEST = 1.0, 0.6  # [m] of a ramp around the trajectory; height where the trajectory is above
TURN_PER_WAY = 3.0  # [rad/m] the same of yaw and joints / of the position
PLACES, COARSE = 60, 40  # at which a run-up is looked at; lengths within a room
INSIDE = 1e-6  # [m]
FADES = 4, 8, 14  # of a detour: the larger, the later


def at_rest(rows: np.ndarray) -> bool:
    """Return whether value, rate, ... (ROWS, n) are those of a rest."""
    return all(np.abs(row).max() <= limit for row, limit in zip(rows[1:], AT_REST[1:], strict=True))


class Needs(NamedTuple):
    """What a trajectory needs, so that a ramp to it needs no more."""

    limits: np.ndarray  # (2, 3) acceleration, jerk, snap of the position, and of yaw and joints
    force: float  # largest [m/s^2 per mass]
    tilt: float  # largest [rad]
    low: np.ndarray  # (3,) the room [m]
    high: np.ndarray  # (3,)
    least: np.ndarray  # (2, 3) gentle limits

    @classmethod
    def of(cls, path: Polynomials, options: ScenarioOptions) -> Needs:
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
    """Return force per mass (m,) [m/s^2], tilt (m,) [rad] of rows (m, 5, 6 + n), without drag."""
    push = rows[:, CHI_DDOT, POSITION] + (0.0, 0.0, GRAVITY)
    force = np.linalg.norm(push, axis=1)
    return force, np.arccos(np.clip(push[:, Z] / np.maximum(force, 1e-9), -1.0, 1.0))


def _sizes(rows: np.ndarray) -> np.ndarray:
    """Return (m, 2, 5) of rows (m, 5, 6 + n): norms of the position, largest of yaw and joints."""
    ways = np.linalg.norm(rows[:, :, POSITION], axis=2)
    return np.stack([ways, np.abs(rows[:, :, YAW:]).max(axis=2)], axis=1)


def within_room(goal: np.ndarray, low: np.ndarray, high: np.ndarray) -> Iterator[Polynomials]:
    """Yield run-ups to goal (ROWS, 6 + n), the shortest first, that detours keep in the box low,
    high (3,) [m]: an offset of each axis at the begin, which fades early or late."""
    u = np.linspace(0.0, 1.0, PLACES, endpoint=False)
    fades = np.array([_fade(power) for power in FADES])  # (f, d)
    offset = Polynomials(np.arange(2.0), fades.T[None]).rows(u, 1)[0][:, None]  # (m, 1, f)
    for tenths in np.unique(np.geomspace(*RAMP_LENGTHS, COARSE).astype(int)):
        ramp = ramp_up(goal, tenths / PER_SECOND)
        places = ramp.rows(u * ramp.length, 1)[0, :, POSITION]  # (m, 3)
        short, far = (
            np.maximum(beyond[:, :, None] / offset, 0.0).max(axis=0)
            for beyond in (low - places, places - high)
        )
        detours = np.where(short > far, short, -far)  # (3, f)
        for fade in product(*(range(len(FADES)) if any(axis) else (0,) for axis in detours)):
            detoured = places + offset[:, 0, fade] * detours[range(3), fade]
            if (detoured < low - INSIDE).any() or (detoured > high + INSIDE).any():
                continue
            powers = np.zeros((fades.shape[1], goal.shape[1]))
            powers[:, POSITION] = fades[fade, :].T * detours[range(3), fade]
            yield added(ramp, Polynomials(ramp.knots, powers[None]))


def _fade(power: int) -> np.ndarray:
    """Return the powers of u = 0..1 of a curve from 1 to 0 whose rate is u^power (1 - u)^4."""
    way, orders = np.zeros(max(FADES) + 6), np.arange(power + 1, power + 6)
    way[orders] = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / orders
    way /= -way.sum()
    way[0] = 1.0
    return way
