"""The reference under supervision: follow the scenario, stop on it, resume, descend, or rest.

Each manoeuvre starts at the current reference with its rates and accelerations, so the reference
of the controllers never jumps.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ALPHA, ARM, CHI, CHI_DOT, JERK, POSITION, YAW, X, Y, Z
from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Number, put, record
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.course import NEXT, Course, Cue
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.braking import Braking
from uam_control.mission.motion.flatness import write_reference
from uam_control.mission.motion.path_clock import STEADY, PathClock, scale
from uam_control.mission.motion.polynomials import HARDEST, PEAK
from uam_control.mission.motion.segments import Segment, WayBack, arm_length, at_rest, stop_length
from uam_control.mission.motion.trajectory import Trajectory, empty_motion, write_motions
from uam_control.mission.plans import BASE, BOTH, Goal, Plan
from uam_control.mission.scenarios.route import SINK

COMING_BACK = (Course.BRAKE, Course.REST, Course.BACK)
# following: number of the next of the motions ahead
WHOLE, REAL = "following", "scenario_time gravity rate_max acceleration_max"
MOST = 64  # motions ahead
PACE_TIME = 1.0  # [s] longest time in which a grasp stops the clock at rest, see `Guidance.pace`


class GuidanceArrays(NamedTuple):
    """What compiled functions use of a `Guidance`."""

    reference: np.ndarray
    motion: np.ndarray
    motions: np.ndarray  # (MOST, 5, 6 + n) ahead, on the path
    times: np.ndarray  # (MOST,) [s] of them
    drag: np.ndarray  # (3,) [1/s]
    numbers: np.ndarray  # (1,) WHOLE, REAL


class Guidance:
    """Writes the reference of a flight; the mission calls `stop`, `go_on`, `retreat` and `descend`.

    `motion` (5, 6 + n): `reference` without attitude, with jerk and snap. `trajectory`: the path by
    the scenario time; one that takes its place equals it then. `scenario_time` [s]: time on the
    scenario, constant during a hold. `arrays` are never replaced.
    """

    scenario_time = Number()

    def __init__(
        self,
        trajectory: Trajectory,
        stamp: float,
        reference: np.ndarray,
        stowed: Sequence[float],
        parameters: MissionParameters,
        end: float = 0.0,
    ) -> None:
        """stamp [s]: of the take-off; reference: array to write; stowed: landing angles [rad];
        end [s]: scenario time at which the path ends."""
        self._end = end
        self.reference = reference  # (3, 6 + n) of the last `write`, attitude by `flatness`
        self.motion = motion = empty_motion(reference.shape[1] - ALPHA)
        self.memory, self._drag = record(WHOLE, REAL), np.zeros(3)
        ahead = np.zeros((MOST, *motion.shape)), np.zeros(MOST)
        self.arrays = GuidanceArrays(reference, motion, *ahead, self._drag, self.memory)
        self.configure(parameters)
        self._publish = bound(publish, self.arrays)
        self.trajectory, self._stowed = trajectory, np.array(stowed, dtype=float)
        self._clock = PathClock(stamp)
        self._rates = STEADY  # derivatives of the scenario time
        self._path = np.zeros_like(self.motion)
        self._arm: Segment | None = None  # in place of the path's, while holding
        self._away: WayBack | None = None  # offset from the path, on the way back to it
        self._brake: Braking | Segment | None = None  # in place of the path, after a release
        self.course = Course.PATH  # what it does, by the table of `course`
        self._due = math.inf  # stamp [s] at which a course of limited time ends, see `Cue`
        self._plans: dict[bool, Plan] = {}  # in place of the path; True: of the base, False: arm
        self._last: Segment | None = None  # in place of the path, until the end of the flight
        # of the path, see `Shift.add` and `PayloadWatch.clear`
        self.shift: Callable[[np.ndarray], None] = lambda motion: None
        self.clear: Callable[[np.ndarray], np.ndarray] = lambda chi: np.zeros(3)

    def configure(self, parameters: MissionParameters) -> None:
        """Use `parameters` (validated) from the next manoeuvre on."""
        self.parameters, m = parameters, self.memory
        self._drag[:] = parameters.drag
        m["gravity"], m["rate_max"] = parameters.gravity, parameters.attitude_rate_max
        m["acceleration_max"] = parameters.attitude_acceleration_max

    @property
    def end(self) -> float:
        """Return the stamp [s] at which a descent reaches the ground, inf without one."""
        return math.inf if self._last is None else self._last.end

    def advance(self, stamp: float) -> None:
        """Set the scenario time for `stamp` [s]; call before `write`. No effect in a descent."""
        if self.course is Course.END:
            return
        if stamp >= self._due:
            if self.course is Course.REST:
                self.go_on(stamp)
            if stamp >= self._due and self._take(Cue.ARRIVED):
                self._arm = None
                self._clock.change(stamp, 1.0, self._ramp_length())
        time, one, two, three, four = self._clock.at(stamp)
        self.scenario_time, self._rates = time, (one, two, three, four)

    def write(self, stamp: float) -> None:
        """Write motion and reference at `stamp` [s]."""
        self._write_motion(stamp)
        self._publish()

    def _write_motion(self, stamp: float) -> None:
        motion = self.motion
        if self._last is not None:
            self._last.write(stamp, motion)
            return
        self._write_path(motion)
        if self._arm is not None:
            self._arm.write(stamp, self._path)
            motion[:, ARM] = self._path[:, ARM]
        if self._away is not None:
            self._away.write(stamp, self._path)
            motion[:, :ALPHA] += self._path[:, :ALPHA]
            if stamp >= self._away.end:
                self._away = None
        if self._brake is not None:
            self._brake.write(stamp, motion)
        for plan in self._plans.values():
            plan.write(stamp, motion)

    def on_path(self, stamp: float) -> bool:
        """Return whether the reference follows the path at the pace of the stamps, from the newest
        `advance` on, at `stamp` [s]."""
        on_path = self.course is Course.PATH and not self.coming_back and self._arm is None
        return on_path and self.goes_on and self._clock.settled <= stamp and self._rates == STEADY

    def look_ahead(self, stamps: np.ndarray, until: float) -> int:
        """Compute the path for `follow_path` at stamps (m,) [s], at most MOST.

        Only `on_path`. Returns for how many the scenario's time is below `until` [s].
        """
        times = self._clock.settled_at(stamps)
        count = int(np.searchsorted(times, until))
        self.arrays.times[:count] = times[:count]
        motions = self.arrays.motions[:count]
        write_motions(self.trajectory, times[:count], motions)
        for motion in motions:
            self.shift(motion)
        self.memory["following"] = 0
        return count

    def pace(self, stamp: float, rate: float) -> None:
        """Change the rate [1] of the scenario's clock: 1 on, 0 stop, -1 back along the path.

        No effect while the path is left, or about to go on after a stop.
        """
        if rate != self._clock.goal and self.course is Course.PATH:
            self._clock.change(stamp, rate, self._ramp_length(PACE_TIME))

    @property
    def goes_on(self) -> bool:
        """Return whether the scenario's clock runs on, or is about to: no grasp stops it."""
        return self._clock.goal == 1.0

    @property
    def coming_back(self) -> bool:
        """Return whether the path is left, or about to go on after a stop; not for a plan."""
        return self.course in COMING_BACK or self._away is not None

    @property
    def planned(self) -> bool:
        """Return whether a plan is flown, or held after its end, in place of the path."""
        return bool(self._plans) and self.course is not Course.END

    def on_way_to(self, goal: Goal, stamp: float) -> Plan | None:
        """Return the plan that leads to an equal goal already, None without one."""
        parts = ((True, BASE), (False, ARM))
        plans = [self._plans.get(base) for base, part in parts if goal.columns in (part, BOTH)]
        leads = self.planned and all(plan and plan.leads_to(goal, stamp) for plan in plans)
        return plans[0] if leads else None

    def arrived(self, stamp: float) -> bool:
        """Return whether every plan is at its end at `stamp` [s]; False without a plan."""
        return self.planned and all(stamp >= plan.end for plan in self._plans.values())

    def preview(self, stamp: float, step: float, longest: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the planned chi (m, 6 + n) from `stamp` [s] on, every `step` [s] to its end.

        Also returns the stamps (m,) [s]. A hold is one point; after it the path is not planned.
        longest [s]: of the part that is returned.
        """
        motion = self._last or self._plans.get(True) or self._brake
        begin, end = (stamp, motion.end) if motion else (self.scenario_time, self._end)
        if motion is None and self._clock.goal == 0.0 and self.course is not Course.BACK:
            return np.array([stamp]), self.motion[CHI][None].copy()
        times = np.arange(begin, min(max(end, begin), begin + longest) + step, step)
        row, rows = np.zeros_like(self.motion), []
        for time in times.tolist():
            row[:] = self.motion
            (motion or self.trajectory).write(min(time, end), row)
            rows.append(row[CHI].copy())
        return stamp + times - begin, np.array(rows)

    def fly(self, stamp: float, plan: Plan) -> None:
        """Leave the path for `plan`, made at `stamp` [s] from the motion; call after `write`."""
        base = plan.columns is BASE
        if self._take(Cue.GOAL if base else Cue.ARM_GOAL):
            self._plans[base] = plan
            self._stop_clock(stamp)
            if base:
                self._away = self._brake = None

    def follow(self, stamp: float, state: np.ndarray) -> None:
        """Set the reference to the vehicle's pose, at rest, while somebody else has control.

        Call it after `write`; state (3, 6 + n). A pose that is not finite is not followed.
        """
        if not np.all(np.isfinite(state[CHI])):
            return
        pose = self.motion[:, :ALPHA]
        pose[:] = 0.0
        pose[CHI, POSITION], pose[CHI, YAW] = state[CHI, POSITION], state[CHI, YAW]
        self._publish()

    def stay(self, stamp: float, state: np.ndarray, ground: float, age: float = 0.0) -> None:
        """Begin in the vehicle's motion of state (3, 6 + n), and come to rest; see `Braking`.

        Call it after `write`, when the laws begin: after a release, and at each tick without a
        controller. age [s]: of the state at `stamp` [s]. A joint that is farther from its reference
        than `start_arm_error` begins at its angle. `go_on` then returns to the path.
        """
        if not np.all(np.isfinite(state[CHI])) or not self._take(Cue.STAY):
            return
        self._plans.pop(True, None)
        self._away = None
        self._brake = Braking(stamp - age, state, self.parameters, ground)
        angles = state[CHI, ARM]
        if np.any(np.abs(angles - self.motion[CHI, ARM]) > self.parameters.start_arm_error):
            self.give_way(stamp, angles)
        self.write(stamp)

    @property
    def fast(self) -> bool:
        """Return whether the reference moves across faster than a landing may."""
        across = self.motion[CHI_DOT, X:Z]
        return math.hypot(across.item(0), across.item(1)) > self.parameters.travel_speed

    def stop(self, stamp: float, stow: bool, acceleration: float | None = None) -> None:
        """Slow down to a stop on the path from `stamp` [s] on; stow: move the arm to `stowed`.

        acceleration [m/s^2]: in place of stop_acceleration. A descent ends: `stay` then sets the
        reference. A plan ends in a stop, too, on its curve.
        """
        length = stop_length(self.motion, self.parameters, acceleration=acceleration)
        for plan in self._plans.values():
            plan.stop(stamp, length)
        self._take(Cue.STOP)
        self._stop_clock(stamp, acceleration)
        if self._last is not None:
            self._arm = self._arm_segment(stamp, self._at_rest(stow=False)[0][ARM])
            self._last = self._brake = None
            self._plans.clear()
        if stow:
            self.move_arm(stamp)

    def move_arm(self, stamp: float, angles: np.ndarray | None = None, hurry: float = 1.0) -> None:
        """Move the arm to `angles` [rad] from `stamp` [s] on, see `arm_length`; None: stow it."""
        self._arm = self._arm_segment(stamp, self._stowed if angles is None else angles, hurry)
        self._plans.pop(False, None)

    def give_way(self, stamp: float, angles: np.ndarray) -> None:
        """Let the arm yield to what pushes it: its reference is its `angles` (n,) [rad], at rest.

        Call it after `write`, at each tick; afterwards the arm stays where it is.
        """
        if np.all(np.isfinite(angles)):
            self.motion[CHI, ARM], self.motion[CHI_DOT:, ARM] = angles, 0.0
            self.move_arm(stamp, angles)
            self._publish()

    def go_on(self, stamp: float) -> None:
        """Continue on the path once the stop is complete and the arm is back at its path angles.

        A brake comes to rest first, and so does the path, which a shift may still move. From below
        the path a vehicle leaves an obstacle first.
        """
        if self._brake is not None:
            if self.course is not Course.REST and self._below_path:
                self.retreat(stamp)
            ends = max(self._brake.end, self._clock.settled)
            if stamp < ends or np.any(self._on_path()[CHI_DOT:JERK, POSITION]):
                if self._take(Cue.WAIT):
                    self._due = max(ends, stamp)
                return
        if not self._take(Cue.RESTED if self.course is Course.REST else Cue.GO_ON):
            return
        self._due = max(stamp, self._clock.settled)
        if self._brake is not None or self._plans.pop(True, None) is not None:
            path = self._on_path()
            offset = self.motion - path
            if self._brake is not None:  # at rest, as the path; small rates grow on a long way
                offset[CHI_DOT:] = 0.0
            self._brake = None
            offset[CHI, YAW] = wrap_angle(offset[CHI, YAW])
            offset[:, ARM] = 0.0
            self._away = WayBack(stamp, offset, self.parameters)
        if self._plans.pop(False, None) is not None or self._arm is not None:
            time = self._clock.at(self._due)[0]
            self.trajectory.write(time, self._path)
            self._arm = self._arm_segment(stamp, self._path[CHI, ARM])
            self._due = max(self._due, self._arm.end)
        if self._away is not None:
            self._due = max(self._due, self._away.end)

    def descend(self, stamp: float, state: np.ndarray, ground: float, stow: bool) -> None:
        """Descend vertically from the position in state (3, 6 + n) to the height `ground` [m].

        A `fast` reference needs a way to its rest, straight on and off the path: `stop` it first.
        """
        p, now = self.parameters, self.motion
        offset = state[CHI, POSITION] - now[CHI, POSITION]
        if not np.all(np.isfinite(offset)):  # then descend from the reference
            offset = np.zeros(3)
        goal, lengths = self._at_rest(stow)
        across = float(np.hypot(offset[X], offset[Y]))
        lengths[X:Z] = max(lengths[X], PEAK * across / p.travel_speed)
        goal[X:Z] += offset[X:Z]
        goal[Z] = ground - SINK
        way = abs(goal[Z] - now[CHI, Z])
        # the other coordinates are at rest before touchdown
        lengths[Z] = max(
            np.max(lengths) + p.stop_time,
            PEAK * way / p.travel_speed,
            math.sqrt(HARDEST * way / p.stop_acceleration),
        )
        self._take(Cue.END)
        self._last = Segment(stamp, now, goal, lengths)
        self._clock.change(stamp, 0.0, self._ramp_length())  # for a scenario that goes on later

    def retreat(self, stamp: float, hurried: bool = False) -> float:
        """Move clear of an obstacle near the place of rest, off the path and up.

        `go_on` returns to the path. Level from below it: straight up the arm is caught under a
        stand's top. hurried: with brake_acceleration, else with travel_speed. Returns the
        stamp [s] of the arrival, `stamp` where nothing is near.
        """
        goal, lengths = self._at_rest(stow=False)
        way = self.clear(goal)
        if self._below_path:
            way[Z] = 0.0
        if not np.any(way) or not self._take(Cue.RETREAT):
            return stamp
        goal[POSITION] += way
        p, far = self.parameters, float(np.linalg.norm(way))
        hurry = math.sqrt(HARDEST * far / p.brake_acceleration)
        lengths[:] = max(float(np.max(lengths)), hurry if hurried else PEAK * far / p.travel_speed)
        self._plans.pop(True, None)
        self._brake, self._away = Segment(stamp, self.motion, goal, lengths, BASE), None
        return self._brake.end

    @property
    def _below_path(self) -> bool:
        """Whether the reference is off the path, and more than contact_error below it."""
        if self._brake is None:
            return False
        return bool((self._on_path() - self.motion)[CHI, Z] > self.parameters.contact_error)

    def _take(self, cue: Cue) -> bool:
        """Change the course by the table of `course`; return whether the cue has a transition."""
        target = NEXT.get((self.course, cue))
        if target is not None:
            self.course, self._due = target, math.inf
        return target is not None

    def _stop_clock(self, stamp: float, acceleration: float | None = None) -> None:
        """Slow down to a stop on the path."""
        self._clock.change(stamp, 0.0, self._ramp_length(acceleration=acceleration))

    def _on_path(self) -> np.ndarray:
        """Return the path (5, 6 + n) at the scenario time; the next call reuses the array."""
        self._write_path(self._path)
        return self._path

    def _write_path(self, path: np.ndarray) -> None:
        """Write the path (5, 6 + n) at the scenario time, by the chain rule for its clock."""
        self.trajectory.write(self.scenario_time, path)
        if self._rates != STEADY:
            scale(path, self._rates)
        self.shift(path)

    def _at_rest(self, stow: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return goal and duration [s] of each coordinate to rest; stow: the arm to `stowed`."""
        p = self.parameters
        acceleration = p.stop_acceleration if self._brake is None else p.brake_acceleration
        return at_rest(self.motion, acceleration, p, self._stowed if stow else None)

    def _arm_segment(self, stamp: float, angles: np.ndarray, hurry: float = 1.0) -> Segment:
        goal = self.motion[CHI].copy()
        goal[ARM] = angles
        length = arm_length(self.motion, angles, self.parameters, hurry)
        return Segment(stamp, self.motion, goal, np.full_like(goal, length))

    def _ramp_length(self, shortest: float = math.inf, acceleration: float | None = None) -> float:
        """Return the time [s] in which the path's clock stops or resumes; see `stop_length`."""
        self.trajectory.write(self.scenario_time, self._path)
        return stop_length(self._path, self.parameters, shortest, acceleration)


@borrowing
def publish(a: GuidanceArrays) -> None:
    """Write the motion to the reference, with the attitude that it needs."""
    m = a.numbers[0]
    write_reference(a.motion, a.drag, m.gravity, m.rate_max, m.acceleration_max, a.reference)


@borrowing
def follow_path(a: GuidanceArrays) -> None:
    """Write the next motion that `Guidance.look_ahead` has computed, and its reference."""
    m = a.numbers[0]
    m.scenario_time = a.times[m.following]
    for row in range(len(a.motion)):
        put(a.motions[m.following, row], a.motion[row])
    m.following += 1
    publish(a)
