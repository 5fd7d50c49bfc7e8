"""Planned motions: a curve through points, begun at the present reference, at rest at the end.

The curve consists of quintic polynomials between points with rates and accelerations. A second
quintic, the blend, takes the reference from its present value, rate and acceleration to the curve;
so the sum has no jump in value, rate or acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from uam_control.coordinates import ALPHA, ARM, CHI, CHI_DDOT, CHI_DOT, POSITION, YAW, Z
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.path_clock import STEADY, PathClock, scale
from uam_control.mission.motion.polynomials import RAMP, quintic, quintic_at

BASE = slice(0, ALPHA)  # columns of a reference that a base plan writes
BOTH = slice(None)  # those of base and arm
LONGER = 1.01  # precision of a blend's length
TINY = 1e-9  # [m/s]
SAME = 1e-3  # [m, rad, s or their rates] by which equal goals may differ
MIN_STEP = 0.004  # [s] shortest time between two points
MOST_POINTS = 500  # of a trajectory; the check of more takes longer than a tick
ROUNDING = 1e-9  # [m or rad] beyond a limit
AT_REST = 1e-3  # [m/s or rad/s] rate of a last point that counts as zero


class PlanRefused(ValueError):
    """A goal or trajectory that is not flown; the text is one line: what, where, what is allowed"""


class Plan:
    """A curve through points plus a blend that decays to zero; afterwards the last point.

    It may be stopped on its way; then it stays there.
    """

    def __init__(
        self,
        stamp: float,
        times: np.ndarray,
        points: np.ndarray,
        blend: Blend,
        goal: Goal,
        columns: slice | None = None,
    ) -> None:
        """stamp [s]: of the start. times (m,) [s] from there, increasing from 0, m at least 2.

        points (3, m, k): values, rates and accelerations; the last point is at rest. goal: that the
        plan leads to; columns: the k of the reference that the plan writes, None: the goal's.
        """
        self.columns, self._goal = columns or goal.columns, goal
        self._stamp, self._times, self._points = stamp, times, points
        lengths = np.diff(times)[:, None]
        self._powers = quintic(points[:, :-1], points[:, 1:], lengths)
        self._blend = blend
        offset = blend.start - points[:, 0]
        self._offset = quintic(offset, np.zeros_like(offset), blend.length)
        self._length = max(float(times[-1]), blend.length)
        self._clock = PathClock(stamp)

    @property
    def parts(self) -> tuple[Plan, ...]:
        """The plans of base and arm, which begin and end together; itself, if it is one of them."""
        if self.columns is not BOTH:
            return (self,)
        found = []
        for part in (BASE, ARM):
            blend = replace(self._blend, start=self._blend.start[:, part])
            motion = self._stamp, self._times, self._points[:, :, part]
            found.append(Plan(*motion, blend, self._goal, part))
        return tuple(found)

    @property
    def end(self) -> float:
        """The stamp [s] from which on the plan is at rest."""
        return self._clock.settled if self._stopped else self._stamp + self._length

    @property
    def _stopped(self) -> bool:
        return self._clock.goal == 0.0

    def leads_to(self, goal: Goal, stamp: float) -> bool:
        """Return whether an equal goal at `stamp` [s] changes nothing."""
        if self._stopped or type(goal) is not type(self._goal) or not goal.equals(self._goal):
            return False
        return stamp < self.end or not goal.closed

    def stop(self, stamp: float, length: float) -> None:
        """Slow down to a stop on the curve within `length` [s] from `stamp` [s] on.

        No effect at the end, or if it stops already.
        """
        if stamp < self.end:
            self._clock.change(stamp, 0.0, length)

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return values, rates .. snaps (5, q, k) at times (q,) [s] from the start."""
        row = np.clip(
            np.searchsorted(self._times, times, side="right") - 1, 0, len(self._times) - 2
        )
        lengths = (self._times[row + 1] - self._times[row])[:, None]
        u = np.clip((times - self._times[row])[:, None] / lengths, 0.0, 1.0)
        values = quintic_at(self._powers[:, row], u, lengths)
        arrived = times >= self._times[-1]  # without rounding errors
        values[:, arrived] = 0.0
        values[CHI, arrived] = self._points[CHI, -1]
        u = np.minimum(times / self._blend.length, 1.0)[:, None]
        values += np.where(u < 1.0, quintic_at(self._offset[:, None], u, self._blend.length), 0.0)
        return values

    def write(self, stamp: float, motion: np.ndarray) -> None:
        """Write the plan's columns of motion (5, 6 + n) at `stamp` [s]."""
        now = self._clock.at(stamp)  # time, then its derivatives
        rows = self.at(np.array(now[:1]))[:, 0]
        if now[1:] != STEADY:
            scale(rows, now[1:])
        motion[:, self.columns] = rows

    def samples(self, per_piece: int = 10) -> np.ndarray:
        """Return times (q,) [s] from the start for checks: several in every polynomial."""
        knots = np.append(self._times, self._length)
        inner = knots[:-1, None] + np.diff(knots)[:, None] * np.arange(per_piece) / per_piece
        blend = np.linspace(0.0, self._blend.length, 2 * per_piece)
        return np.unique(np.concatenate([inner.ravel(), blend, knots[-1:]]))


@dataclass(frozen=True)
class Blend:
    """The present reference, start (3, k), and the time [s] in which a plan leaves it."""

    start: np.ndarray
    length: float

    @classmethod
    def of(cls, reference: np.ndarray, columns: slice, p: MissionParameters) -> Blend:
        """Blend from reference (3, 6 + n): long enough to stop with the allowed acceleration."""
        speed = float(np.linalg.norm(reference[CHI_DOT, POSITION])) if columns != ARM else 0.0
        length = max(p.stop_time, 2.0 * RAMP * speed / p.stop_acceleration)
        return cls(reference[: CHI_DDOT + 1, columns].copy(), length)

    @property
    def stop(self) -> np.ndarray:
        """The values (k,) at which a motion stops within the blend's length; cubic in its rate."""
        value, rate, acceleration = self.start
        return value + rate * self.length / 2 + acceleration * self.length**2 / 12

    def way(self, goal: np.ndarray, mean: float, brake: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times (m,) and points (3, m, k) of the straight way from the stop to goal (k,).

        The rate changes within the blend's length to the way / mean [s], and within brake [s] to
        zero. So the sum of way and blend has the present rate, then that of the way: a goal that
        replaces another one does not brake.
        """
        rate, begin = (goal - self.stop) / mean, mean + (self.length - brake) / 2
        times = np.array([0.0, self.length, begin, begin + brake])
        points = np.zeros((3, 4, len(goal)))
        points[CHI] = self.stop, self.stop + rate * self.length / 2, goal - rate * brake / 2, goal
        points[CHI_DOT, 1:3] = rate
        apart = np.append(True, np.diff(times) > MIN_STEP / 2)
        return times[apart], points[:, apart]


class Goal:
    """What a plan leads to. columns: BASE, ARM or BOTH, of the reference.

    closed: whether it ends where it begins, to be flown again.
    """

    columns: slice
    closed = False
    still = False  # whether it asks for no motion, so that it only ends one
    compared: tuple[str, ...] = ()  # arrays that equal goals have alike
    note = ""  # of the answer, what is changed of what was asked for

    def solved(self, reference: np.ndarray, p: MissionParameters, ground: float) -> Goal:
        """Return the goal in coordinates of base and arm, from reference (3, 6 + n) on.

        ground [m]: height at take-off. Raises PlanRefused.
        """
        return self

    def equals(self, other: Goal) -> bool:
        """Return whether another goal of this type is the same."""
        pairs = [(getattr(self, name), getattr(other, name)) for name in self.compared]
        same = (
            a.shape == b.shape and np.allclose(a, b, 0.0, SAME, equal_nan=True) for a, b in pairs
        )
        return bool(pairs) and all(same)

    def check(self, reference: np.ndarray, p: MissionParameters) -> None:
        """Raise PlanRefused for what cannot be planned from reference (3, 6 + n)."""

    def plan(self, stamp: float, reference: np.ndarray, p: MissionParameters) -> Plan:
        """Return the plan from reference (3, 6 + n) at `stamp` [s]."""
        raise NotImplementedError


@dataclass(frozen=True)
class GoalPose(Goal):
    """A pose to fly to."""

    position: np.ndarray  # (3,) [m, ENU]; a height of NaN: the present one
    yaw: float = math.nan  # [rad]; NaN: the present heading
    arm: np.ndarray | None = None  # angles (n,) [rad], if it moves
    asked: Goal | None = None  # the goal that it solves

    @property
    def columns(self) -> slice:
        return BASE if self.arm is None else BOTH

    def equals(self, other: GoalPose) -> bool:
        """Return whether both are the same place, with the same coordinates left open."""
        turn = self.yaw - other.yaw
        near = np.allclose(self.position, other.position, 0.0, SAME, equal_nan=True)
        both_open = math.isnan(self.yaw) and math.isnan(other.yaw)
        return near and (both_open or abs(wrap_angle(turn)) <= SAME)

    def check(self, reference: np.ndarray, p: MissionParameters) -> None:
        """Raise PlanRefused for coordinates that are no numbers."""
        across = self.position[:2]
        if not np.isfinite(across).all() or math.isinf(self.position[2]) or math.isinf(self.yaw):
            raise PlanRefused("a coordinate of the goal is not finite")

    def plan(self, stamp: float, reference: np.ndarray, p: MissionParameters) -> Plan:
        now = reference[: CHI_DDOT + 1, self.columns].copy()
        blend, needed = Blend(now, 0.0), p.stop_time
        while needed > LONGER * blend.length:  # until the velocity changes gently enough
            blend = replace(blend, length=needed)
            start, goal = blend.stop, blend.stop.copy()
            given = np.isfinite(self.position)
            goal[:3][given] = self.position[given]
            if not math.isnan(self.yaw):
                goal[YAW] = start[YAW] + wrap_angle(self.yaw - start[YAW])
            if self.arm is not None:
                goal[ARM] = self.arm
            way, turn = float(np.linalg.norm(goal[:3] - start[:3])), abs(goal[YAW] - start[YAW])
            # without a cruise: mean * speed = way, for a brake of stop_time, and a longer one
            steep, begin = RAMP / p.stop_acceleration, blend.length
            shortest = 2.0 * way / (begin + p.stop_time)
            longest = (math.sqrt(begin**2 + 8.0 * steep * way) - begin) / (2.0 * steep)
            speed = min(p.goal_speed, shortest, longest)
            brake = max(p.stop_time, steep * speed)
            swing = float(np.abs(goal[ARM] - start[ARM]).max(initial=0.0)) / p.stow_rate
            mean = max((begin + brake) / 2, way / max(speed, TINY), turn / p.goal_yaw_rate, swing)
            change = (goal[:3] - start[:3]) / mean - blend.start[CHI_DOT, :3]
            needed = max(p.stop_time, steep * float(np.linalg.norm(change)))
        return Plan(stamp, *blend.way(goal, mean, brake), blend, self.asked or self)


@dataclass(frozen=True)
class Points(Goal):
    """A trajectory of base or arm or both."""

    times: np.ndarray  # (m,) [s] from the start
    points: np.ndarray  # (3, m, k); NaN: rate, acceleration by differences of the row above
    columns: slice  # BASE, ARM or BOTH, of a reference
    asked: Goal | None = None  # the goal that it solves
    compared = "times", "points"

    @property
    def closed(self) -> bool:
        """Whether it ends where it begins: sent again after its end it is flown again."""
        ends = self.points[CHI, 0], self.points[CHI, -1]
        return len(self.times) > 1 and np.allclose(*ends, 0.0, SAME)

    def plan(self, stamp: float, reference: np.ndarray, p: MissionParameters) -> Plan:
        """Return the plan from reference (3, 6 + n) at `stamp` [s].

        A first point after time 0 is reached from the reference within its time.
        """
        blend, goal = Blend.of(reference, self.columns, p), self.asked or self
        times, points = self.times, self.points.copy()
        if self.columns != ARM:
            yaw = np.unwrap(points[CHI, :, YAW])
            present = blend.start[CHI, YAW]
            points[CHI, :, YAW] = yaw + wrap_angle(yaw[0] - present) - (yaw[0] - present)
        if len(times) == 1:
            length = max(times[0], 2.0 * MIN_STEP) if times[0] else 2.0 * blend.length
            blend = replace(blend, length=min(blend.length, length / 2))
            way = blend.way(points[CHI, 0], length - blend.length, blend.length)
            return Plan(stamp, *way, blend, goal)
        if times[0] > 0.0:
            first = np.zeros((3, 1, points.shape[2]))
            if times[0] > blend.length:
                first[CHI, 0] = blend.stop
            else:
                blend, first[:, 0] = replace(blend, length=times[0]), blend.start
            times, points = np.append(0.0, times), np.concatenate([first, points], axis=1)
        fill_differences(times, points, blend.start)
        return Plan(stamp, *_stopped(times, points, p), blend, goal)

    def check(self, reference: np.ndarray, p: MissionParameters) -> None:
        """Raise PlanRefused for bad times and numbers, or a first point far from the reference.

        reference (3, 6 + n); only a first point at time 0 must be near it.
        """
        self.check_numbers()
        if self.times[0] > 0.0:
            return
        apart = np.abs(self.points[CHI, 0] - reference[CHI, self.columns])
        if self.columns != ARM:
            way = float(np.linalg.norm(apart[:3]))
            if way > p.plan_start_distance:
                raise PlanRefused(
                    f"the first point is {way:.2f} m from the reference, "
                    f"{p.plan_start_distance:g} m allowed"
                )
            apart = np.abs(wrap_angle(apart[3:]))
        if apart.max() > p.plan_start_angle:
            raise PlanRefused(
                f"the first point is {apart.max():.2f} rad from the reference, "
                f"{p.plan_start_angle:g} rad allowed"
            )

    def check_numbers(self) -> None:
        """Raise PlanRefused for bad times and numbers."""
        times, points = self.times, self.points
        if len(times) == 0:
            raise PlanRefused("no points")
        if times[0] < 0.0:
            raise PlanRefused(f"time_from_start of the first point is {times[0]:g} s, below 0")
        if len(times) > MOST_POINTS:
            raise PlanRefused(f"{len(times)} points, at most {MOST_POINTS} allowed")
        late = np.flatnonzero(np.diff(times) < MIN_STEP)
        if len(late):
            i = int(late[0]) + 1
            raise PlanRefused(
                f"time_from_start of point {i}, {times[i]:g} s, must be at least {MIN_STEP:g} s "
                f"after point {i - 1}, {times[i - 1]:g} s"
            )
        if not np.isfinite(points[CHI]).all():
            raise PlanRefused("a position is not finite")


def fill_differences(times: np.ndarray, points: np.ndarray, start: np.ndarray) -> None:
    """Replace rows of points (3, m, k) that are NaN by central differences.

    Those of the first point by the present reference's, start (3, k); zero at the end.
    """
    for row in (CHI_DOT, CHI_DDOT):
        missing = np.isnan(points[row]).any(axis=1)
        slopes = np.zeros_like(points[row])
        if len(times) > 2:
            slopes[1:-1] = np.gradient(points[row - 1], times, axis=0)[1:-1]
        slopes[0] = start[row]
        points[row, missing] = slopes[missing]


def _stopped(
    times: np.ndarray, points: np.ndarray, p: MissionParameters
) -> tuple[np.ndarray, np.ndarray]:
    """Return times and points with a stop at the end, if the last point moves."""
    speed = float(np.abs(points[CHI_DOT, -1]).max())
    points[CHI_DDOT, -1] = 0.0
    if speed <= AT_REST:
        points[CHI_DOT, -1] = 0.0
        return times, points
    length = max(p.stop_time, 2.0 * RAMP * speed / p.stop_acceleration)
    last = np.zeros((3, 1, points.shape[2]))
    last[CHI, 0] = points[CHI, -1] + points[CHI_DOT, -1] * length / 2
    return np.append(times, times[-1] + length), np.concatenate([points, last], axis=1)


def room(p: MissionParameters, ground: float) -> np.ndarray:
    """Return the corners (2, 3) [m] of the base's room; ground [m]: height at take-off."""
    found = p.room(ground)
    found[0, Z] = max(found[0, Z], ground + p.airborne_height)
    return found


def check(plan: Plan, p: MissionParameters, ground: float) -> None:
    """Raise PlanRefused if the plan leaves a limit anywhere; ground [m]: height at take-off.

    A plan that begins beyond a limit of position or angle may come back, but not go further.
    """
    times = plan.samples()
    values = plan.at(times)
    if plan.columns is BASE:
        names, unit = ("x", "y", "z"), "m"
        low, high = room(p, ground)
        within = values[CHI, :, POSITION]
    else:
        names, unit = [f"alpha_{i + 1}" for i in range(values.shape[2])], "rad"
        (low, high), within = p.joint_ranges, values[CHI]
    low_now, high_now = np.minimum(low, within[0]), np.maximum(high, within[0])
    for i, name in enumerate(names):
        beyond = np.maximum(low_now[i] - within[:, i], within[:, i] - high_now[i])
        k, end = int(np.argmax(beyond)), within[-1, i]
        if not low[i] - ROUNDING <= end <= high[i] + ROUNDING:
            k = len(times) - 1
        elif beyond[k] <= ROUNDING:
            continue
        raise PlanRefused(
            f"{name} is {within[k, i]:.2f} {unit} after {times[k]:.1f} s, "
            f"allowed {low[i]:g} to {high[i]:g} {unit}"
        )
    for what, found, limit, unit in _rates(plan, values, p):
        k = int(np.argmax(found))
        if found[k] > limit:
            raise PlanRefused(
                f"{what} is {found[k]:.2f} {unit} after {times[k]:.1f} s, allowed {limit:g} {unit}"
            )


def _rates(plan: Plan, values: np.ndarray, p: MissionParameters) -> list[tuple]:
    """Return (quantity, values (q,), limit, unit) of the rates of a plan's samples (3, q, k)."""
    if plan.columns is ARM:
        rate, acceleration = (np.abs(values[row]).max(axis=1) for row in (CHI_DOT, CHI_DDOT))
        return [
            ("joint rate", rate, p.plan_joint_rate, "rad/s"),
            ("joint acceleration", acceleration, p.plan_joint_acceleration, "rad/s^2"),
        ]
    speed, acceleration = (
        np.linalg.norm(values[row, :, POSITION], axis=1) for row in (CHI_DOT, CHI_DDOT)
    )
    yaw_rate, yaw_acceleration = (np.abs(values[row, :, YAW]) for row in (CHI_DOT, CHI_DDOT))
    return [
        ("speed", speed, p.plan_speed, "m/s"),
        ("acceleration", acceleration, p.plan_acceleration, "m/s^2"),
        ("yaw rate", yaw_rate, p.plan_yaw_rate, "rad/s"),
        ("yaw acceleration", yaw_acceleration, p.plan_yaw_acceleration, "rad/s^2"),
    ]
