"""The mission as others see it: commands of an operator or planner, and compiled ticks.

A command is checked here and done by the next step. For compiled ticks: when they may step the
sequence, and on which arrays.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from uam_control.ages import SILENT
from uam_control.coordinates import CHI, Z
from uam_control.maths.compiled import borrowing
from uam_control.mission.flight_sequence import FlightSequence
from uam_control.mission.ground import on_ground
from uam_control.mission.guidance import GuidanceArrays, follow_path
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.braking import leaves_geofence
from uam_control.mission.plans import Goal, PlanRefused, check
from uam_control.supervision import Authority, Guide, OperatorCommand, State
from uam_control.supervision.checks import CheckArrays, measure_all
from uam_control.supervision.observation import NUMBERS, ReadingArrays
from uam_control.supervision.supervisor import stays_behind
from uam_control.vehicle import NO_GRIPPER, TWO_FINGER, closes

AUTOPILOT_AGE = NUMBERS.index("autopilot_age")
FOLLOWS = (State.TAKING_OFF, State.FLYING, State.LANDING)  # states that follow the scenario


class MissionArrays(NamedTuple):
    """State of a `Mission`."""

    guidance: GuidanceArrays
    checks: CheckArrays
    supervisor: np.ndarray  # (1,) memory
    watch: np.ndarray  # (1,) memory of its `PayloadWatch`
    numbers: np.ndarray  # (1,) WHOLE, REAL of `flight_sequence`


class Mission(FlightSequence):
    """A sequence that takes commands: each is refused with a reason, or the next step does it.

    While it only follows its scenario, compiled functions step it.
    """

    def start(self) -> tuple[bool, str]:
        """Desire an armed autopilot from the next step on; the take-off follows.

        After the end of a flight it begins the next one. Returns whether it is accepted, and the
        reason of a refusal in one line.
        """
        output, seen = self.output, self._seen
        if self._start.dry_run:
            return False, "refused: dry run, nothing is armed"
        if seen is None:
            return False, "refused: no state of the vehicle yet"
        if output.done and not seen.armed:
            self._begin(self._parameters)
            self._supervisor.step(self._stamp, seen)
        if output.state is not State.GROUNDED or output.arm:
            return False, f"refused: not while {output.state.value}"
        if self.not_ready:
            return False, f"refused: {self.not_ready}"
        self._supervisor.start()
        return True, "arming"

    def request(self, command: OperatorCommand) -> tuple[bool, str]:
        """Queue a command for the next step.

        Returns whether it is accepted, and the command or the reason of the refusal in one line.
        """
        if self._seen is None:
            return False, "no state of the vehicle yet"
        refusal = self._supervisor.refusal(command, self._seen)
        if not refusal and command is OperatorCommand.RESUME:
            refusal = self._stops_outside()
        if refusal:
            return False, f"refused: {refusal}"
        self._requests.append((command, None))
        return True, command.value.value

    def _stops_outside(self) -> str:
        """Say by how much a released vehicle would leave the geofence before it stops; "" if not.

        Control stays with the pilot then: taken over there, the vehicle would only land.
        """
        state = self._seen.state
        if self.output.state is not State.RELEASED or not np.all(np.isfinite(state[CHI])):
            return ""
        return leaves_geofence(self._stamp, state, self._parameters, self._ground)

    def plan(self, goal: Goal) -> tuple[bool, str]:
        """Check a goal or trajectory; queue it for the next step if it can be flown.

        It replaces the path or the plan before it. At its end the mission holds until a command.
        A goal equal to the one that is flown or reached changes nothing. Returns whether it is
        accepted, and the length of the plan or the reason of the refusal.
        """
        if self._seen is None:
            return False, "refused: no state of the vehicle yet"
        refusal = self._supervisor.refusal(OperatorCommand.GOAL, self._seen)
        if refusal:
            return False, f"refused: {refusal}"
        parameters, motion = self._parameters, self._guidance.motion
        moves = self._guidance.planned and not self._guidance.arrived(self._stamp)
        if goal.still and not moves:
            return True, "accepted: nothing to stop"
        made = self._guidance.on_way_to(goal, self._stamp)
        if made is None:
            try:
                goal = goal.solved(motion, parameters, self._ground)
                goal.check(motion, parameters)
                made = goal.plan(self._stamp, motion, parameters)
                for part in made.parts:
                    check(part, parameters, self._ground)
            except PlanRefused as error:
                hint = " (on a fast path: /mission/hold first)" if self._guidance.fast else ""
                return False, f"refused: {error}{hint}"
            self._ask_for(goal)
        return True, f"accepted: {goal.note}at the end in {max(0.0, made.end - self._stamp):.1f} s"

    def _ask_for(self, goal: Goal) -> None:
        """Queue a goal for the next step, in place of one that waits for it."""
        columns = goal.columns
        waiting = (one for one in self._requests if one[1] is None or one[1].columns != columns)
        self._requests = deque([*waiting, (OperatorCommand.GOAL, goal)])

    def preview(self, step: float, longest: float) -> tuple[np.ndarray, np.ndarray]:
        """Return stamps (m,) [s] and planned chi (m, 6 + n), every `step` [s]; m = 0 on the ground.

        longest [s]: of the part that is returned.

        Nothing is planned in failsafe or while somebody else has control.
        """
        idle = self.output.state in (State.FAILSAFE, State.DISARMED, State.RELEASED)
        if self._guidance is None or idle:
            return np.zeros(0), np.zeros((0, self.output.reference.shape[1]))
        return self._guidance.preview(self._stamp, step, longest)

    def switch_magnet(self, on: bool) -> tuple[bool, str]:
        """Override the magnet until the scenario switches it next; returns as `request` does."""
        if self.output.state is State.DISARMED:
            return False, "refused: not while disarmed"
        self._override.give(on, self._scenario_magnet())
        return True, f"magnet {'on' if on else 'off'} until the scenario switches it next"

    def command_gripper(self, opening: float) -> tuple[bool, str]:
        """Close or open the gripper as `switch_magnet` does; opening [m], 0 or 1 of a magnet."""
        p = self._parameters
        if p.gripper == NO_GRIPPER:
            return False, "refused: the vehicle has no gripper"
        if (close := closes(opening, p.gripper_opening)) is None:
            low, high = sorted(p.gripper_opening)
            return False, f"refused: opening {opening:g} is outside {low:g} to {high:g}"
        accepted, reason = self.switch_magnet(close)
        done = f"{'closes' if close else 'opens'} until the scenario grips or opens next"
        return accepted, done if accepted else reason

    @property
    def gripper_state(self) -> float:
        """The measured opening [m]; of a magnet 1 on, 0 off; NaN: unknown."""
        if self._parameters.gripper != TWO_FINGER:
            return float(self.output.magnet)
        return math.nan if self._seen is None else self._seen.readings.grip.item(0)

    def _begin(self, parameters: MissionParameters) -> None:
        super()._begin(parameters)
        self.arrays: MissionArrays | None = None  # None before a flight

    def _arrange(self) -> None:
        """Collect the arrays of a flight."""
        supervisor, m, p = self._supervisor, self.memory, self._parameters
        m["height"], m["speed"] = p.touchdown_height, p.touchdown_speed
        m["half"] = self.scenario.landing.half
        self.arrays = MissionArrays(
            *(self._guidance.arrays, self.checks.arrays),
            *(supervisor.memory, self._watch.memory, m),
        )

    @property
    def nominal(self) -> bool:
        """Whether the next steps only follow the scenario, until a value or a message demands more:
        then `follow_scenario` does them, see `look_ahead`."""
        output, supervisor, guidance = self.output, self._supervisor, self._guidance
        decision = supervisor.decision
        ended = self._over or output.done or self._end is not None
        return (
            guidance is not None
            and output.state in FOLLOWS
            and output.flying
            and decision.guide is Guide.SCENARIO
            and decision is self._followed
            and supervisor.calm
            and guidance.on_path(self._stamp)
            and self._watch.shift.settled
            and self._touchdown.idle
            and not (ended or self._requests or self._override.given)
            and self._standing is None
            and self._descent is None
            and self._beside is None
            and self._magnet_on(decision) == output.magnet
            and self._phase(decision) == output.phase
        )

    def look_ahead(self, stamps: np.ndarray) -> int:
        """Compute the path at the next stamps (m,) [s], at most `guidance.MOST`, while `nominal`.

        Returns for how many of them nothing of the scenario changes.
        """
        landing, state = self.scenario.landing, self.output.state
        lands = state is State.LANDING
        wait = 0.0 if self._odometry else self._parameters.touchdown_timeout
        until = landing.end + wait if lands else landing.at
        self.memory["takes_off"] = state is State.TAKING_OFF
        self._watch.due_from = self._watch_from
        changes = (*self.scenario.phases, *self.scenario.magnet)
        time = self._guidance.scenario_time
        until = min([at for at, _ in changes if at > time] + [until])
        return self._guidance.look_ahead(stamps, until)

    @property
    def looked_ahead(self) -> int:
        """Number of the steps that `follow_scenario` has done since `look_ahead`."""
        return self._guidance.memory["following"].item()

    def watch(self) -> bool:
        """Step the executive of the grasps after a compiled step; return whether the steps that
        `look_ahead` has computed still are to come."""
        path = self._guidance.trajectory
        self.watch_payload()
        self._watch.due_from = self._watch_from
        return self.nominal and self._guidance.trajectory is path

    def resume(self, state: np.ndarray, authority: Authority) -> None:
        """Go on after compiled steps, the last one with state (3, 6 + n) and authority."""
        seen, self.output.time = self._in_flight, self._stamp - self._takeoff
        seen.on_ground, seen.authority = self._is_on_ground(state), authority

    @property
    def _watch_from(self) -> float:
        """Scenario time [s] from which on the executive of the grasps is due."""
        off = self._parameters.grasp_checks == "off" or self.output.state is not State.FLYING
        return math.inf if off else self._watch.executive.due_from


@borrowing
def follow_scenario(
    a: MissionArrays, readings: ReadingArrays, stamp: float, state: np.ndarray
) -> bool:
    """Do what `Mission.step` does at `stamp` [s], after `Mission.look_ahead`.

    state (3, 6 + n). Returns False, and changes nothing, where something is to be decided.
    """
    m, path, s = a.numbers[0], a.guidance, a.supervisor[0]
    calm = measure_all(a.checks, state, path.reference, m.ground, readings, True)
    late = path.times[path.numbers[0].following] >= m.half
    if not calm or (late and on_ground(state, m.ground, m.height, m.speed)):
        return False
    if readings.values[AUTOPILOT_AGE] > SILENT:  # the arm may give way, see `Mission`
        return False
    if m.takes_off:
        planned = path.reference[CHI, Z] - m.ground
        airborne = state[CHI, Z] - m.ground > s.airborne_height
        if airborne or stays_behind(a.supervisor, stamp, planned):
            return False
    m.stamp = stamp
    s.stamp = stamp
    follow_path(path)
    return True
