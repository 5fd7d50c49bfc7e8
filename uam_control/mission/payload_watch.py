"""Connects the grasp executive with a flight: its inputs, and its effect on the path."""

import math
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np

from uam_control.ages import AHEAD
from uam_control.arm.hand import shoulder
from uam_control.coordinates import ALPHA, CHI, MOTION_ROWS, POSITION, Z
from uam_control.grasp import (
    Grasp,
    GraspExecutive,
    GraspWindow,
    Sight,
    grasp_windows,
)
from uam_control.grasp.sight import PlaceHistory, hand_and_levers
from uam_control.maths.compiled import jit, prepared
from uam_control.maths.memory import Number, record
from uam_control.mission.guidance import Guidance
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.polynomials import PEAK
from uam_control.mission.motion.segments import Segment
from uam_control.mission.motion.trajectory import Move, Moves, Trajectory
from uam_control.mission.scenarios.scenario import Scenario
from uam_control.supervision import Readings

ABOVE = 0.5  # of clear_distance: nearer to a stand, a vehicle that descends level meets it
TURNS = (0.0, *(s * math.radians(a) for a in (30.0, 60.0, 90.0) for s in (1.0, -1.0)))  # of a way
RAISED = "stand", "table", "shelf", "box"  # of the environment: not to be landed on
SPEED = 0.05  # [m/s] peak speed of a change
SHORTEST = 1.0  # [s] of a change


class Shift:
    """Shift of the positions of a path, with its rates; constant after each change."""

    def __init__(self) -> None:
        self._values = np.zeros((MOTION_ROWS, 3))
        self.value = self._values[CHI]  # (3,) [m] the present one, read only
        self._goal = np.zeros(3)
        self._aimed: np.ndarray | None = None  # the array of the last change
        self._beside = False  # whether the goal is not zero
        self._segment: Segment | None = None

    def aim(self, stamp: float, goal: np.ndarray) -> None:
        """Change to `goal` (3,) [m] from `stamp` [s] on; no effect if that is the goal already.

        The array must not change afterwards.
        """
        if goal is self._aimed or np.array_equal(goal, self._goal):
            return
        self._aimed, self._goal, self._beside = goal, goal.copy(), bool(goal.any())
        way = float(np.max(np.abs(goal - self.value)))
        length = max(SHORTEST, PEAK * way / SPEED)
        self._segment = Segment(stamp, self._values, goal, np.full(3, length))

    @property
    def settled(self) -> bool:
        """Return whether no change is under way."""
        return self._segment is None

    def advance(self, stamp: float) -> None:
        """Set the shift for `stamp` [s]; call it before `add`."""
        if self._segment is not None:
            self._segment.write(stamp, self._values)
            if stamp >= self._segment.end:
                self._segment = None

    def add(self, motion: np.ndarray) -> None:
        """Add the shift to the positions of a motion (5, 6 + n)."""
        if self._beside or self._segment is not None:
            motion[:, POSITION] += self._values


class WithoutDescent:
    """A trajectory that stays at the height of a window's begin until the end of its climb."""

    def __init__(
        self, trajectory: Trajectory, window: GraspWindow, time: float, like: np.ndarray
    ) -> None:
        """time [s]: of the scenario now; like (5, 6 + n): a motion of the same size."""
        self._inner, self._window = trajectory, window
        self._begin = begin = min(max(window.descent, time), window.lifted - 1e-3)
        self._level = np.zeros_like(like)
        ends = []
        for at in (begin, window.lifted):
            trajectory.write(at, self._level)
            ends.append(self._level[CHI].copy())
        move = Move("z", begin, window.lifted, float(ends[1][Z]))
        self._between = Moves(ends[0], [move])

    def write(self, time: float, motion: np.ndarray) -> None:
        """Write the motion (5, 6 + n); see `Trajectory.write`."""
        self._inner.write(time, motion)
        if self._begin < time < self._window.lifted:
            self._between.write(time, self._level)
            motion[:, Z] = self._level[:, Z]


class PayloadWatch:
    """The executive of a flight, stepped at its own period while the scenario is flown."""

    _stepped, _period, due_from = Number(), Number(), Number()

    def __init__(
        self, scenario: Scenario, guidance: Guidance, parameters: MissionParameters
    ) -> None:
        self.memory = record("", "stepped period due_from")
        windows = grasp_windows(scenario.motions, scenario.magnet, dict(scenario.approaches))
        self.executive = GraspExecutive(windows, scenario.payload_mass, parameters)
        self._guidance = guidance
        self.configure(parameters)
        self.shift = Shift()  # of the path
        guidance.shift, guidance.clear = self.shift.add, self.clear
        self._stepped = -math.inf  # stamp [s]
        self._period = self.executive.period
        self._due = prepared(due, self.memory, 0.0, 0.0)
        self._places = PlaceHistory()  # of the tool
        self._planned: tuple[GraspWindow, np.ndarray] | None = None  # tool at its descent
        self._left_out: GraspWindow | None = None
        grips = [self._tool_at(window.grip)[:Z] for window in windows]
        self._stands = [*grips, *_raised(scenario.environment or ())]

    def configure(self, parameters: MissionParameters) -> None:
        """Use `parameters` (validated) from the next step on."""
        self._parameters = self.executive.parameters = parameters
        self._chain, joints = parameters.chain(), self._guidance.motion.shape[1] - ALPHA
        known = self._chain.has_hand and len(self._chain.masses) == joints
        self._hand = partial(hand_and_levers, self._chain) if known else None
        self._loaded = shoulder(self._chain) if known else 0  # a yaw joint's lever is zero

    @property
    def standing(self) -> bool:
        """Whether a payload that was approached has not been lifted from its stand."""
        return self.executive.grasp is Grasp.APPROACHED and not self.executive.lifted

    def interrupt(self) -> None:
        """The scenario is not flown at this tick."""
        self.executive.interrupt()
        self._places.restart()  # the vehicle moves on unseen

    def step(self, stamp: float, state: np.ndarray, readings: Readings) -> str:
        """Step the executive at `stamp` [s] if it is due; apply its directive.

        state (3, 6 + n). Returns the reason to end the mission, "" without one.
        """
        executive, guidance = self.executive, self._guidance
        self.due_from = executive.due_from  # [s] scenario time from which on it is stepped
        if not self._due(self.memory, stamp, guidance.scenario_time):
            return ""
        if not all(map(math.isfinite, state[CHI].tolist())):  # faster than numpy on eight numbers
            return ""
        self._stepped = stamp
        directive = executive.step(self._sight(stamp, state, readings))
        self._period = executive.period
        guidance.pace(stamp, directive.pace)
        self.shift.aim(stamp, directive.shift)
        window = directive.without_descent
        if window is not None and window is not self._left_out:
            self._left_out = window
            now, motion = guidance.scenario_time, guidance.motion
            guidance.trajectory = WithoutDescent(guidance.trajectory, window, now, motion)
        return directive.land

    def _sight(self, stamp: float, state: np.ndarray, readings: Readings) -> Sight:
        p, chi = self._parameters, state[CHI]
        tool, levers = self._hand_at(chi)
        self._places.add(readings.stamp, tool)
        sight = Sight(
            stamp,
            self._guidance.scenario_time,
            tool,
            error=chi[POSITION] - self._guidance.reference[CHI, POSITION],
            lift=readings.lift,
            throttle=readings.throttle,
            lever=float(levers[self._loaded]),
            on_path=not self._guidance.coming_back,
            shifting=not self.shift.settled,
        )
        sight.opening, sight.squeeze = readings.grip.tolist()
        if self._hand and -AHEAD <= readings.payload_age <= p.payload_age:
            sight.payload = readings.payload_position + self.executive.point
            sight.tool_then = self._places.at(readings.stamp - readings.payload_age)
            self._look_ahead(sight)
        if len(readings.joint_effort):
            sight.effort = float(readings.joint_effort[self._loaded])
        return sight

    def _look_ahead(self, sight: Sight) -> None:
        """Set the tool's way on the path until the descent begins, without the path's shift."""
        window = self.executive.aligns_for
        if window is None:
            return
        if self._planned is None or self._planned[0] is not window:
            self._planned = window, self._tool_at(window.descent)
        now, _ = self._hand_at(self._guidance.reference[CHI])
        sight.ahead = self._planned[1] - now + self.shift.value

    def _tool_at(self, time: float) -> np.ndarray:
        """Return the tool's place (3,) [m] on the path at `time` [s] of the scenario."""
        guidance = self._guidance
        motion = np.zeros_like(guidance.motion)
        guidance.trajectory.write(time, motion)
        return self._hand_at(motion[CHI])[0]

    def _hand_at(self, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `hand_and_levers` of chi (6 + n,); below the base for an arm that is unknown."""
        if self._hand:
            return self._hand(chi)
        return chi[POSITION].copy(), np.zeros(max(1, len(chi) - ALPHA))

    def above_stand(self, chi: np.ndarray) -> bool:
        """Whether a level descent from chi (6 + n,) may come down on a stand."""
        near = ABOVE * self._parameters.clear_distance
        return any(math.hypot(*(chi[:Z] - stand)) < near for stand in self._stands)

    def clear(self, chi: np.ndarray) -> np.ndarray:
        """Return the way (3,) [m] from chi (6 + n,) up and away from a stand nearby, else zeros.

        Straight away from the nearest stand; to a side where that leaves the geofence, or comes
        near another stand.
        """
        p, way, here = self._parameters, np.zeros(3), chi[:Z]
        stand = min(self._stands, key=lambda one: math.dist(here, one), default=None)
        if stand is None or math.dist(here, stand) >= p.clear_distance:
            return way
        low, high = np.array(p.geofence_low), np.array(p.geofence_high)
        straight = math.atan2(*(here - stand)[::-1])

        def badness(turn: float) -> tuple[float, float]:
            place = stand + p.clear_distance * _along(straight + turn)
            beyond = np.maximum(low[:Z] - place, place - high[:Z]).max()
            near = min(math.dist(place, one) for one in self._stands)
            return max(0.0, beyond), round(max(0.0, p.clear_distance - near), 2)

        turn = min(TURNS, key=badness)
        way[:Z] = stand + p.clear_distance * _along(straight + turn) - here
        way[Z] = min(p.clear_height, max(0.0, high[Z] - chi[Z]))
        return way


def _along(angle: float) -> np.ndarray:
    """Return the unit vector (2,) at an angle [rad] from x."""
    return np.array([math.cos(angle), math.sin(angle)])


def _raised(environment: Iterable[Mapping[str, Any]]) -> list[np.ndarray]:
    """Return the places (2,) [m] of what a vehicle would come down on."""
    return [np.array(one["position"][:2]) for one in environment if one["kind"] in RAISED]


@jit
def due(watch: np.ndarray, stamp: float, time: float) -> bool:
    """Return whether a `PayloadWatch` is due at `stamp` [s] and the scenario's `time` [s]; watch
    (1,): its memory."""
    m = watch[0]
    return stamp - m.stepped >= m.period - 1e-6 and time >= m.due_from
