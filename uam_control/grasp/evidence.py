"""Evidence that the tool holds the payload, by the kind of the gripper.

The motion capture of the payload decides where it is available: it measures the fact itself, for
any mass. Without it the mass decides, identified twice: from the vertical force of the position law
and from the torque of the arm's first joint, each against its value before the descent. Both are
fused by their variances. Whether the thrust suffices is judged by the mass before the pick, then by
what is sent.
"""

import math
from typing import NamedTuple

import numpy as np

from uam_control.grasp.grasp_parameters import GraspParameters
from uam_control.grasp.sight import Lasting, Sight
from uam_control.vehicle import GRAVITY
from uam_control.vehicle.gripper import MAGNET, NO_GRIPPER, TWO_FINGER

LIFT_DEVIATION = 0.03  # [kg] of the mass from the force: vertical gusts during a lift
TORQUE_DEVIATION = 0.08  # [N m] of the torque: dry friction of a joint
SHARE = 0.5  # of the tool's travel that the payload must follow
LEAST_TRAVEL = 0.02  # [m] on which that is based at least

SHORT_AFTER = 0.3  # [s] at carry_throttle
SUNK = 0.08  # [m] below the path
REACH = 0.003  # [m] height above the payload below which the tool has contact
SLACK = 0.1  # of the stroke, within which the fingers are at an end
PRESSED = 0.5  # of the force limit: the fingers press on something


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
    """Return the evidence of the payload's distance from the tool; it cannot tell held."""
    if not sight.tracked:
        return Evidence(None, "payload not tracked")
    apart = math.dist(sight.payload.tolist(), sight.tool_then.tolist())
    if math.isnan(apart):
        return Evidence(None, "payload's pose of an unknown place of the tool")
    if apart > p.held_distance:
        return Evidence(False, f"{1e3 * apart:.0f} mm from the payload at {place(sight.payload)}")
    return Evidence(None, f"payload {1e3 * apart:.0f} mm from the tool")


def by_travel(sight: Sight, tool: np.ndarray, payload: np.ndarray, p: GraspParameters) -> Evidence:
    """Return the evidence of the payload's pose: near the tool, and moved with it.

    tool, payload (3,) [m]: `tool_then` and grip point at the grip. The direction does not matter:
    an arm that turns meanwhile may lower the tool as much as the vehicle climbs.
    """
    near = by_pose(sight, p)
    if near.held is False or not sight.tracked:
        return near
    travel, moved = sight.tool_then - tool, sight.payload - payload
    length = float(np.linalg.norm(travel))
    along = float(moved @ travel) / max(length, 1e-9)
    if math.isnan(along):
        return near
    text = f"payload moved {1e3 * along:.0f} mm of the tool's {1e3 * length:.0f} mm"
    return Evidence(True if along >= SHARE * max(length, LEAST_TRAVEL) else None, text)


def identified_mass(before: Load, now: Load, lever: float) -> float:
    """Return the mass [kg] that the tool carries, NaN if unknown; lever [m]: see `Sight`."""
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


def fused(sight: Sight, pose: Evidence, own: Evidence, mass: Evidence) -> Evidence:
    """Return the verdict: of the pose for a tracked payload, else of the gripper's `own` evidence,
    else of the mass; a gripper that feels nothing holds nothing. All texts."""
    felt = own.held if own.held is not None else mass.held
    held = pose.held if sight.tracked and own.held is not False else felt
    return Evidence(held, ", ".join(filter(None, (pose.text, own.text, mass.text))))


def against(pose: Evidence, own: Evidence) -> Evidence:
    """Return the evidence of the pose, or the gripper's `own` where it feels nothing."""
    return own if own.held is False else pose


def touches_beside(sight: Sight, distance: float) -> bool:
    """Return whether the tool touches a payload, at least `distance` [m] beside its middle."""
    away = sight.tool - sight.payload
    return bool(away[2] < REACH and np.hypot(*away[:2]) >= distance)


class GripperKind:
    """One kind: without a measurement of its own, as an electromagnet or a suction cup.

    `early`: it may act before the contact.
    """

    early = True

    def held(self, sight: Sight, p: GraspParameters) -> Evidence:
        """Return whether it holds something, as far as it feels it; "" without a measurement."""
        return Evidence(None, "")

    def let_go(self, sight: Sight, p: GraspParameters) -> bool:
        """Return whether it has let go what it held, as far as it feels it."""
        return False


class Fingers(GripperKind):
    """Two fingers that report opening and force: closed without resistance, they hold nothing."""

    early = False

    def held(self, sight: Sight, p: GraspParameters) -> Evidence:
        if math.isnan(sight.opening):
            return Evidence(None, "fingers not measured")
        text = f"fingers {1e3 * sight.opening:.0f} mm open, {sight.squeeze:.1f} N"
        if self._part(sight, p) <= SLACK:
            return Evidence(False, text)
        return Evidence(True if sight.squeeze >= PRESSED * p.gripper_force else None, text)

    def let_go(self, sight: Sight, p: GraspParameters) -> bool:
        return self._part(sight, p) >= 1.0 - SLACK

    @staticmethod
    def _part(sight: Sight, p: GraspParameters) -> float:
        """Return the part of the stroke by which they are open, 0..1."""
        closed, opened = p.gripper_opening
        return (sight.opening - closed) / (opened - closed)


GRIPPERS = {NO_GRIPPER: GripperKind(), MAGNET: GripperKind(), TWO_FINGER: Fingers()}


def expected_throttle(sight: Sight, mass: float) -> float:
    """Return the thrust as sent, 0..1, with a further mass [kg]; NaN if unknown.

    Thrust is proportional to it where THR_MDL_FAC is the motors', see `thrust_curve`.
    """
    return sight.throttle * (1.0 + mass * GRAVITY / sight.lift) if sight.lift > 0.0 else math.nan


class ThrustReserve:
    """`short`: whether the thrust has been at its end for SHORT_AFTER.

    A rotor at its end shows late: the autopilot then takes thrust for its torques, the vehicle
    sinks a little, and the thrust that is sent rises to 1.
    """

    def __init__(self) -> None:
        self._at_end = Lasting()
        self.short = False

    def restart(self) -> None:
        """Forget all values."""
        self._at_end.restart()
        self.short = False

    def add(self, sight: Sight, p: GraspParameters) -> None:
        """Take the next sight."""
        lasts = self._at_end(sight.stamp, sight.throttle >= p.carry_throttle)
        self.short = lasts >= SHORT_AFTER

    def sinks(self, sight: Sight) -> bool:
        """Return whether the vehicle sinks for want of thrust."""
        return self.short and bool(sight.error[2] < -SUNK)
