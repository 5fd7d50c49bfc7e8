"""Goals of the end effector: a pose, a trajectory, a jog. Each is solved for base and arm.

A pose and a trajectory become goals of base and arm, which are flown as those of planners are; so
both arrive together. The base does what it can alone: the arm keeps its posture, and leaves it for
elevation and lean of the tool, or where the base would leave its room.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uam_control.arm.hand import ELEVATION, HEADING, LEAN, hands, tools
from uam_control.arm.placing import BEYOND, CLOSE, HINGE, TURNED, Placed, Room, placed, turning
from uam_control.coordinates import ARM, CHI, CHI_DDOT, CHI_DOT, POSITION, ROLL, YAW, Z
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.flatness import Flyer, flattened
from uam_control.mission.plans import (
    BOTH,
    SAME,
    Blend,
    Goal,
    GoalPose,
    Plan,
    PlanRefused,
    Points,
    fill_differences,
    room,
)

UPRIGHT = math.radians(80.0)  # lean from which on the heading is lost
TURNED_BY = math.radians(1.0)  # by which the tool may miss elevation and lean
WITHIN = 0.03  # [rad] of the joints' ranges: at their ends the supervisor holds
TILTING = 0.1  # [rad] kept from the ends of the hand's hinge: the base tilts on its way
# [m] of the base's room, lowest and highest x y z: at its ends, too, but not at its floor
KEPT = np.array([[0.05, 0.05, 0.0], [-0.05, -0.05, -0.05]])
FAR = 100.0  # [m] from the base's room: no arm is as long
INSIDE = 1e-6  # [m] beyond the base's room: no goal is refused for its last digit
# A jog stops in SHARE of the way at full speed, BENT of length^2 times its acceleration, and
# STEEPEST times the mean one: the quintic that ends without jerk, so gently.
SHARE, BENT, STEEPEST = 0.4, 0.05, 16 / 9
MISTAKEN = 1.0, 2.0  # [m/s, rad/s] beyond which the velocity of a jog is in another unit
SLOWER = 0.99  # share of what is asked for, below which the answer tells it
ROUNDS = 3  # of the base's tilt, which follows from its own motion
PLACE = slice(0, HEADING + 1)  # of TOOL: x y z heading


@dataclass(frozen=True)
class HandPose(Goal):
    """A pose of the end effector: wanted (6,), columns TOOL [m, rad].

    A heading of NaN keeps the present one, elevation and lean of NaN are free.
    """

    flyer: Flyer
    wanted: np.ndarray
    columns = BOTH

    def equals(self, other: HandPose) -> bool:
        """Return whether both are the same pose, with the same left open."""
        apart = self.wanted - other.wanted
        apart[HEADING:] = wrap_angle(apart[HEADING:])
        open_too = np.array_equal(np.isnan(self.wanted), np.isnan(other.wanted))
        return open_too and not np.any(np.abs(apart) > SAME)

    def solved(self, reference: np.ndarray, p: MissionParameters, ground: float) -> GoalPose:
        """Return the goal of base and arm; see `Goal.solved`."""
        if not np.isfinite(self.wanted[POSITION]).all() or np.isinf(self.wanted).any():
            raise PlanRefused("a coordinate of the goal is not finite")
        wanted = self.wanted.copy()
        if math.isnan(wanted[HEADING]):
            wanted[HEADING] = tools(self.flyer.chain, reference[[CHI]])[0, HEADING]
        chi = _met(self.flyer, wanted[None], reference, p, ground)[0]
        return GoalPose(chi[POSITION], float(chi[YAW]), chi[ARM], self)


@dataclass(frozen=True)
class HandPoints(Goal):
    """A trajectory of the end effector."""

    flyer: Flyer
    times: np.ndarray  # (m,) [s] from the start
    wanted: np.ndarray  # (m, 6) columns TOOL
    rates: np.ndarray  # (2, m, 4) and accelerations of x y z heading; NaN: not given
    columns, compared = BOTH, ("times", "wanted", "rates")

    @property
    def closed(self) -> bool:
        """Whether it ends where it begins."""
        ends = self.wanted[0], self.wanted[-1]
        return len(self.times) > 1 and np.allclose(*ends, 0.0, SAME, equal_nan=True)

    def solved(self, reference: np.ndarray, p: MissionParameters, ground: float) -> Points:
        """Return the trajectory of base and arm; see `Goal.solved`."""
        hand = np.concatenate([self.wanted[None, :, PLACE], self.rates])
        Points(self.times, hand, BOTH).check_numbers()
        chi = _met(self.flyer, self.wanted, reference, p, ground)
        hand[CHI, :, HEADING] = np.unwrap(hand[CHI, :, HEADING])
        fill_differences(self.times, hand, reference[: CHI_DDOT + 1, [*range(3), YAW]])
        points = np.zeros((CHI_DDOT + 1, *chi.shape))
        points[CHI] = chi
        if len(self.times) > 1:
            self._follow(hand, points)
        if not np.isfinite(points).all():
            raise PlanRefused("too fast: a velocity or acceleration that no base can have")
        return Points(self.times, points, BOTH, self)

    def _follow(self, hand: np.ndarray, points: np.ndarray) -> None:
        """Write the motion that has the hand at `hand` (3, m, 4) into points (3, m, 6 + n).

        points[CHI]: of level bases. The base tilts as its acceleration needs.
        """
        base, columns = np.array([*range(3), YAW]), slice(ROLL, YAW)
        points[CHI, :, YAW] = np.unwrap(points[CHI, :, YAW])
        away, arm = np.zeros_like(hand), np.zeros_like(points[..., ARM])
        arm[CHI] = points[CHI, :, ARM]
        _differentiate(self.times, arm)
        points[..., ARM] = arm
        away[CHI] = hand[CHI] - points[CHI][:, base]
        turned = away[CHI, :, HEADING].copy()
        for _ in range(ROUNDS):
            _differentiate(self.times, away)
            points[..., base] = hand - away
            tilted = points.copy()
            flattened(tilted, self.flyer)
            tilted[CHI, :, POSITION] = 0.0
            away[CHI] = hands(self.flyer.chain, tilted[CHI])[:, PLACE]
            away[CHI, :, HEADING] = turned
        points[CHI][:, base] = hand[CHI] - away[CHI]
        points[CHI, :, columns] = 0.0


@dataclass(frozen=True)
class HandTwist(Goal):
    """A jog of the end effector."""

    flyer: Flyer
    linear: np.ndarray  # (3,) [m/s]
    angular: np.ndarray  # (3,) [rad/s]
    of_tool: bool = False  # in the axes of the tool, else of the world
    columns = BOTH

    @property
    def still(self) -> bool:
        return not (self.linear.any() or self.angular.any())

    def equals(self, other: HandTwist) -> bool:
        """Return whether both only end a motion; any other twist goes on from where it is."""
        return self.still and other.still

    def solved(self, reference: np.ndarray, p: MissionParameters, ground: float) -> Jog:
        """Return the velocities of base and arm; see `Goal.solved`."""
        given = np.stack([self.linear, self.angular])
        if not np.isfinite(given).all():
            raise PlanRefused("a velocity is not finite")
        tool = tools(self.flyer.chain, reference[[CHI]])[0]
        linear, angular = given @ _axes(tool).T if self.of_tool else given
        linear = _limited(linear, p.jog_speed, MISTAKEN[0], "m/s")
        angular = _limited(angular, p.jog_turn_rate, MISTAKEN[1], "rad/s")
        rates = np.array([*linear, *_tool_rates(tool, angular)])
        lowest = tool[Z] + rates[Z] * (p.jog_hold + p.jog_stop)
        if rates[Z] < 0.0 and lowest < p.hand_floor:
            raise PlanRefused(_below(lowest, p))
        found, missed = turning(self.flyer.chain, reference[CHI], rates)
        if np.abs(missed).max() > CLOSE + TURNED_BY * np.abs(rates[HEADING:]).max():
            raise PlanRefused("out of reach: the arm cannot turn the tool so")
        share = min(1.0, p.jog_speed / max(float(np.linalg.norm(found[POSITION])), p.jog_speed))
        found *= share
        if np.abs(found[ARM]).max(initial=0.0) > p.plan_joint_rate:
            worst = np.abs(found[ARM]).max()
            raise PlanRefused(
                f"singular: a joint would turn at {worst:.2f} rad/s, allowed {p.plan_joint_rate:g}"
            )
        return Jog(found, self, self._slowed(share * linear, share * angular))

    def _slowed(self, linear: np.ndarray, angular: np.ndarray) -> str:
        """Say how much slower than asked for the jog is, or ""."""
        asked = math.hypot(*self.linear), math.hypot(*self.angular)
        given = math.hypot(*linear), math.hypot(*angular)
        if all(now >= SLOWER * before for now, before in zip(given, asked, strict=True)):
            return ""
        return (
            f"slowed down to {given[0]:.3g} m/s, {given[1]:.2g} rad/s, so that it stops in time; "
        )


@dataclass(frozen=True)
class Jog(Goal):
    """Velocities of base and arm, rates (6 + n,), until the next message; without one, a stop."""

    rates: np.ndarray
    asked: HandTwist
    note: str = ""
    columns = BOTH

    def plan(self, stamp: float, reference: np.ndarray, p: MissionParameters) -> Plan:
        """Return the plan: into the velocity, on for jog_hold, and to rest within jog_stop."""
        start, rates, hold, stop = reference[: CHI_DDOT + 1], self.rates, p.jog_hold, p.jog_stop
        change = start[CHI_DOT] - rates
        bends = (
            np.linalg.norm(change[POSITION]) / p.jog_acceleration,
            abs(change[YAW]) / p.plan_yaw_acceleration,
            np.abs(change[ARM]).max(initial=0.0) / p.plan_joint_acceleration,
        )
        blend = Blend(start.copy(), max(stop, STEEPEST * float(max(bends))))
        begin = start[CHI] + SHARE * change * blend.length
        begin += BENT * start[CHI_DDOT] * blend.length**2
        points = np.zeros((CHI_DDOT + 1, 3, len(rates)))
        points[CHI] = begin + np.outer([0.0, hold, hold + SHARE * stop], rates)
        points[CHI_DOT, :2] = rates
        return Plan(stamp, np.array([0.0, hold, hold + stop]), points, blend, self.asked)


def _met(
    flyer: Flyer, wanted: np.ndarray, reference: np.ndarray, p: MissionParameters, ground: float
) -> np.ndarray:
    """Return chi (m, 6 + n) of base and arm for tools at wanted (m, 6); raise PlanRefused."""
    lowest, upright = wanted[:, Z].min(), np.abs(np.nan_to_num(wanted[:, LEAN])).max()
    if lowest < p.hand_floor:
        raise PlanRefused(_below(lowest, p))
    if upright > UPRIGHT:
        raise PlanRefused(
            f"singular: the tool's y axis leans by {math.degrees(upright):.0f} deg, the heading is "
            f"lost from {math.degrees(UPRIGHT):.0f} deg on"
        )
    space = base_room(p, ground)
    places = wanted[:, POSITION]
    if not np.abs(places - np.clip(places, *space)).max() <= FAR:
        raise PlanRefused(
            f"out of reach: a place is more than {FAR:g} m outside of the base's room"
        )
    hinge = np.array(flyer.hinge) + (TILTING, -TILTING)
    found = placed(flyer.chain, wanted, reference[CHI, ARM], Room(space, joint_room(p), hinge))
    _check_reach(found, space)
    found.chi[:, POSITION] = np.clip(found.chi[:, POSITION], *space)
    return found.chi


def base_room(p: MissionParameters, ground: float) -> np.ndarray:
    """Return the corners (2, 3) [m] of the base's room for a goal; ground [m]: see `room`."""
    return room(p, ground) + KEPT


def joint_room(p: MissionParameters) -> np.ndarray:
    """Return lowest and highest angles (2, n) [rad] of a goal."""
    low, high = p.joint_ranges
    half = np.maximum((high - low) / 2.0 - WITHIN, 0.0)
    return (low + high) / 2.0 + np.stack([-half, half])


def _below(height: float, p: MissionParameters) -> str:
    return f"out of reach: the hand's z is {height:.2f} m, the floor is at {p.hand_floor:g} m"


def _check_reach(found: Placed, space: np.ndarray) -> None:
    """Raise PlanRefused for what the tools miss."""
    which = "point {}: " if len(found.off) > 1 else ""
    beyond, turned = np.abs(found.off[:, BEYOND]), np.abs(found.off[:, TURNED])
    row, axis = np.unravel_index(np.argmax(beyond), beyond.shape)
    if not beyond[row, axis] <= INSIDE:
        low, high = space[:, axis]
        raise PlanRefused(
            f"out of reach: {which.format(row)}the base would be at {'xyz'[axis]} = "
            f"{found.chi[row, axis]:.2f} m, allowed {low:.2f} to {high:.2f} m"
        )
    row, axis = np.unravel_index(np.argmax(turned), turned.shape)
    if not turned[row, axis] <= TURNED_BY:
        raise PlanRefused(
            f"out of reach: {which.format(row)}the arm leaves the tool "
            f"{math.degrees(turned[row, axis]):.0f} deg from its {('elevation', 'lean')[axis]}"
        )
    row = int(np.argmax(np.abs(found.off[:, HINGE])))
    if not abs(found.off[row, HINGE]) <= INSIDE:
        raise PlanRefused(
            f"out of reach: {which.format(row)}the hand's hinge would be "
            f"{abs(math.degrees(found.off[row, HINGE])):.0f} deg too near to its end"
        )


def _differentiate(times: np.ndarray, rows: np.ndarray) -> None:
    """Write rates and accelerations of rows (3, m, k), central differences, at rest at the ends."""
    for row in (CHI_DOT, CHI_DDOT):
        rows[row] = np.gradient(rows[row - 1], times, axis=0)
        rows[row, [0, -1]] = 0.0


def _limited(velocity: np.ndarray, most: float, mistaken: float, unit: str) -> np.ndarray:
    """Return a velocity (3,), slowed down to `most`; raise PlanRefused for one in another unit."""
    size = math.hypot(*velocity)
    if size > mistaken:
        raise PlanRefused(f"too fast: {size:.3g} {unit}, {mistaken:g} {unit} allowed")
    return velocity * (most / max(size, most))


def _axes(tool: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3), tool → world, of TOOL (6,)."""
    heading, lifted, leans = tool[[HEADING, ELEVATION, LEAN]]
    (ch, sh), (cl, sl), (ce, se) = ((math.cos(a), math.sin(a)) for a in (heading, leans, lifted))
    turn = np.array([[ch, -sh, 0.0], [sh, ch, 0.0], [0.0, 0.0, 1.0]])
    turn = turn @ np.array([[1.0, 0.0, 0.0], [0.0, cl, -sl], [0.0, sl, cl]])
    return turn @ np.array([[ce, 0.0, -se], [0.0, 1.0, 0.0], [se, 0.0, ce]])


def _tool_rates(tool: np.ndarray, angular: np.ndarray) -> tuple[float, float, float]:
    """Return the rates [rad/s] of heading, elevation and lean for an angular velocity, world."""
    c, s = math.cos(tool[HEADING]), math.sin(tool[HEADING])
    level = math.cos(tool[LEAN])
    if abs(tool[LEAN]) > UPRIGHT:
        raise PlanRefused("singular: the tool's y axis stands upright, the heading is lost")
    lifted = -float(angular @ (-s, c, 0.0)) / level
    heading = float(angular[2]) + lifted * math.sin(tool[LEAN])
    return heading, lifted, float(angular @ (c, s, 0.0))
