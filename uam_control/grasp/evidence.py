"""Evidence that the magnet holds the payload.

The motion capture of the payload decides where it is available: it measures the fact itself, for
any mass. Without it the mass decides, identified twice: from the vertical force of the position law
and from the torque of the arm's first joint, each against its value before the descent. Both are
fused by their variances.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.grasp.grasp_parameters import GraspParameters
from uam_control.grasp.sight import Sight
from uam_control.vehicle import GRAVITY

LIFT_DEVIATION = 0.03  # [kg] of the mass from the force: vertical gusts during a lift
TORQUE_DEVIATION = 0.08  # [N m] of the torque: dry friction of a joint
SHARE = 0.5  # of the magnet's travel that the payload must follow
LEAST_TRAVEL = 0.02  # [m] on which that is based at least

REACH = 0.003  # [m] height above the payload below which the magnet has contact


class Evidence(NamedTuple):
    """held: None without a verdict; text: the measured values."""

    held: bool | None
    text: str


class Load(NamedTuple):
    """Means of force of the position law [N] and torque of the first joint [N m]."""

    lift: float = math.nan
    effort: float = math.nan


def place(point: np.ndarray) -> str:
    """Return a point (3,) [m] as text."""
    return "({:.2f}, {:.2f}, {:.2f}) m".format(*point)


def by_pose(sight: Sight, p: GraspParameters) -> Evidence:
    """Return the evidence of the payload's distance from the magnet; it cannot tell held."""
    if not sight.tracked:
        return Evidence(None, "payload not tracked")
    apart = math.dist(sight.payload.tolist(), sight.magnet_then.tolist())
    if math.isnan(apart):
        return Evidence(None, "payload's pose of an unknown place of the magnet")
    if apart > p.held_distance:
        return Evidence(False, f"{1e3 * apart:.0f} mm from the payload at {place(sight.payload)}")
    return Evidence(None, f"payload {1e3 * apart:.0f} mm from the magnet")


def by_travel(
    sight: Sight, magnet: np.ndarray, payload: np.ndarray, p: GraspParameters
) -> Evidence:
    """Return the evidence of the payload's pose: near the magnet, and moved with it.

    magnet, payload (3,) [m]: `magnet_then` and grip point when the magnet came on. The direction
    does not matter: an arm that turns meanwhile may lower the magnet as much as the vehicle climbs.
    """
    near = by_pose(sight, p)
    if near.held is False or not sight.tracked:
        return near
    travel, moved = sight.magnet_then - magnet, sight.payload - payload
    length = float(np.linalg.norm(travel))
    along = float(moved @ travel) / max(length, 1e-9)
    if math.isnan(along):
        return near
    text = f"payload moved {1e3 * along:.0f} mm of the magnet's {1e3 * length:.0f} mm"
    return Evidence(True if along >= SHARE * max(length, LEAST_TRAVEL) else None, text)


def identified_mass(before: Load, now: Load, lever: float) -> float:
    """Return the mass [kg] that the magnet carries, NaN if unknown; lever [m]: see `Sight`."""
    masses = [(now.lift - before.lift) / GRAVITY]
    weights = [1.0 / LIFT_DEVIATION**2]
    if lever != 0.0:
        masses.append((now.effort - before.effort) / (GRAVITY * lever))
        weights.append((GRAVITY * lever / TORQUE_DEVIATION) ** 2)
    known = [(m, w) for m, w in zip(masses, weights, strict=True) if math.isfinite(m)]
    if not known:
        return math.nan
    return sum(m * w for m, w in known) / sum(w for _, w in known)


def by_mass(mass: float, expected: float, p: GraspParameters) -> Evidence:
    """Return the evidence of the identified mass [kg].

    expected [kg]: of the scenario's payload. A payload that may be lighter than the limit has no
    verdict.
    """
    if math.isnan(mass):
        return Evidence(None, "mass not identified")
    text = f"identified mass {mass:.2f} kg"
    if mass >= p.held_mass:
        return Evidence(True, text)
    return Evidence(False if expected >= 2.0 * p.held_mass else None, text)


def fused(sight: Sight, pose: Evidence, mass: Evidence) -> Evidence:
    """Return the verdict of the pose for a tracked payload, else that of the mass; both texts."""
    held = pose.held if sight.tracked else mass.held
    return Evidence(held, f"{pose.text}, {mass.text}")


def touches_beside(sight: Sight, distance: float) -> bool:
    """Return whether the magnet touches a payload, at least `distance` [m] beside its middle."""
    away = sight.magnet - sight.payload
    return bool(away[2] < REACH and np.hypot(*away[:2]) >= distance)
