"""The sequence of a flight: waiting, take-off, the scenario's phases, landing, landed or aborted;
the supervisor decides on all transitions."""

import math
from collections import deque

import numpy as np

from uam_control.ages import SILENT
from uam_control.coordinates import ARM, CHI, CHI_DOT, Z
from uam_control.grasp import Grasp, GraspDecision
from uam_control.maths.compiled import prepared
from uam_control.maths.memory import Number, record
from uam_control.mission.ground import (
    GroundPose,
    Standing,
    Touchdown,
    on_ground,
    seek_ground,
    supported,
)
from uam_control.mission.guidance import Guidance
from uam_control.mission.mission_output import (
    ABORTED,
    GOAL,
    HOLD,
    LAND,
    LANDED,
    RELEASED,
    TOUCHDOWN,
    WAITING,
    MagnetOverride,
    MissionOutput,
)
from uam_control.mission.mission_parameters import MissionParameters, StartParameters
from uam_control.mission.motion.trajectory import empty_reference
from uam_control.mission.payload_watch import PayloadWatch
from uam_control.mission.plans import Goal
from uam_control.mission.pre_arm import ChecklistReport, PreArm
from uam_control.mission.scenarios.scenario import Scenario
from uam_control.supervision import (
    Authority,
    Decision,
    Event,
    Guide,
    Observation,
    OperatorCommand,
    PreflightCheck,
    Readings,
    State,
    StateTransition,
    Supervisor,
)
from uam_control.supervision.checks import Checks
from uam_control.supervision.states import STOPPED_STATES
from uam_control.vehicle import VehicleDescription

# takes_off: whether the vehicle is not airborne yet. [s]: newest step, take-off; ground [m] below
# it; height [m], speed [m/s] of a touchdown, and scenario time [s] from which on it is one
WHOLE, REAL = "takes_off", "stamp takeoff ground height speed half"
NOBODY = Authority()  # has taken control from the companion
OLDEST = 0.02  # [s] largest age of a state; the time between two steps is longer after a gap
# in parts of stow_rate, in a failsafe: a payload that hangs down would touch the ground first
HURRY = 2.0


class FlightSequence:
    """Steps through a scenario under supervision; its only time is the stamps of the steps.

    It waits for `start` before it desires an armed autopilot; after the end of a flight `start`
    begins the next one.
    """

    _stamp, _takeoff, _ground = Number(), Number(), Number()

    def __init__(
        self,
        scenario: Scenario,
        parameters: MissionParameters,
        start: StartParameters | None = None,
        vehicle: VehicleDescription | None = None,
        compared: bool = False,
    ) -> None:
        """vehicle: whose limits the pre-arm report compares the reference with, if given;
        compared: the whole reference has been compared before, only its begin is."""
        self.scenario = self._planned = scenario
        self.output = MissionOutput(empty_reference(len(scenario.arm_start)))
        self._start = start or StartParameters()
        self.memory = record(WHOLE, REAL)
        self._on_ground = prepared(on_ground, self.output.reference, 0.0, 0.0, 0.0)
        self._age = 0.0  # [s] of the newest state: one tick
        self._resumed = -math.inf  # stamp [s] of the first tick after a gap
        self._odometry = False
        self._seen: Observation | None = None
        checklist = self._start.require_checklist
        self._pre_arm = PreArm(scenario, checklist, vehicle, compared)
        self._begin(parameters)

    def _begin(self, parameters: MissionParameters) -> None:
        """Set the state before a flight; the object of the output stays."""
        reference = self.output.reference
        self.scenario = self._planned
        reference[:] = 0.0
        reference[CHI, ARM] = self.scenario.arm_start
        vars(self.output).update(vars(MissionOutput(reference)))
        self._supervisor = Supervisor(parameters)
        self._parameters = parameters
        self._requests: deque[tuple[OperatorCommand, Goal | None]] = deque()
        self.plans_flown = 0  # in this flight
        self._guidance: Guidance | None = None
        self._watch: PayloadWatch | None = None
        self._over = ""  # why the mission lands before its end
        self._takeoff = self._ground = 0.0
        self._touchdown = Touchdown()
        self._fell_since = math.inf  # [s] into failsafe, or by a kill
        self._end: float | None = None
        self._override = MagnetOverride()
        self._descent: Decision | None = None  # to land, while the reference makes ready for it
        self._clear_at: float | None = None  # stamp [s] of its arrival clear of a stand, for that
        self._standing: Standing | None = None  # while the arm of a released vehicle is stowed
        self._beside: bool | None = None  # a stand, when the autopilot's own landing began
        self._ground_pose = GroundPose()
        self._followed: Decision | None = None  # the newest decision whose values are in the output
        self._in_flight: Observation | None = None  # of every tick after the take-off
        self._check_reference()

    def _check_reference(self) -> None:
        """Compare the reference with the limits, and hold beyond the delay that it stands."""
        self._pre_arm.check_reference(self._parameters)
        self.checks.follow(self._pre_arm.stands)

    def use_odometry(self) -> None:
        """The poses are those of an odometry: the height of the ground in its frame drifts."""
        self._odometry = True

    def begin_anew(self) -> None:
        """Forget the flight and wait on the ground: for stamps of a new simulation."""
        self._begin(self._parameters)
        self._seen, self._stamp = None, 0.0
        self._pre_arm.checklist = None

    def checklist(self, report: ChecklistReport) -> None:
        """Take the newest state of the checklist; it counts where it is required."""
        self._pre_arm.checklist = report

    def preflight(self) -> tuple[PreflightCheck, ...]:
        """Return the pre-arm report of the newest step; () before the first one."""
        if self._seen is None:
            return ()
        return self._pre_arm.report(self._stamp, self.checks, self._seen, self._parameters)

    @property
    def not_ready(self) -> str:
        """The checks of the pre-arm report that fail, in one line; "" if all are green."""
        return "; ".join(check.text for check in self.preflight() if not check.passed)

    def configure(self, parameters: MissionParameters) -> None:
        """Use `parameters` (validated) from the next step on."""
        self._parameters = parameters
        self._supervisor.configure(parameters)
        if self._guidance is None or self.output.done:
            self._check_reference()
        else:
            self._guidance.configure(parameters)
            self._arrange()
        if self._watch is not None:
            self._watch.configure(parameters)

    @property
    def changes(self) -> list[StateTransition]:
        """Return all transitions so far, in order."""
        return self._supervisor.changes

    @property
    def grasps(self) -> list[GraspDecision]:
        """Return all decisions about the payload so far, in order."""
        return self._watch.executive.decisions if self._watch is not None else []

    @property
    def delay(self) -> float:
        """Return the time [s] by which the scenario's clock is behind, by holds and grasps."""
        guidance, output = self._guidance, self.output
        if guidance is None or output.state is State.DISARMED:
            return 0.0
        return max(0.0, output.time - guidance.scenario_time)

    @property
    def checks(self) -> Checks:
        """The supervisor's checks after the newest step."""
        return self._supervisor.checks

    def step(
        self,
        stamp: float,
        state: np.ndarray,
        armed_since: float | None,
        readings: Readings | None = None,
        authority: Authority | None = None,
    ) -> MissionOutput:
        """Return the output of the next tick, at `stamp` [s]; call it once per tick.

        state (3, 6 + n): newest estimate. armed_since: stamp [s] at which the autopilot reported
        armed, None while disarmed. readings: for the supervisor. authority: who has control, None
        for the companion.
        """
        output, guidance = self.output, self._guidance
        if stamp - self._stamp > OLDEST:
            self._resumed = stamp
        self._age, self._stamp = min(max(stamp - self._stamp, 0.0), OLDEST), stamp
        if guidance is not None:
            output.time = stamp - self._takeoff
        if output.state is not State.DISARMED:
            if guidance is not None:
                guidance.advance(stamp)
                self._watch.shift.advance(stamp)
            seen = self._observe(stamp, state, armed_since, readings or Readings())
            seen.authority, self._seen = authority or NOBODY, seen
            command, goal = self._requests.popleft() if self._requests else (None, None)
            moved = False  # a goal on the way to another one is no transition
            if command is OperatorCommand.GOAL and output.state is State.FLYING:
                moved = guidance.planned and not seen.arrived
            changes = self._supervisor.changes
            before = len(changes)
            decision = self._supervisor.step(stamp, seen, None if moved else command)
            if guidance is not None:
                guidance.write(stamp)
                seek_ground(output.reference, self._since_arrival(decision))
                adrift = seen.readings.pose_controller_age > self._parameters.controller_age_hold
                if adrift and output.state is State.HOLDING:
                    guidance.stay(stamp, state, self._ground, self._age)
                if output.state in (State.RELEASED, State.FAILSAFE):
                    guidance.follow(stamp, state)
                event = changes[-1].event if len(changes) > before else None
                if event is Event.GOAL or (moved and event is None):
                    for part in goal.plan(stamp, guidance.motion, self._parameters).parts:
                        guidance.fly(stamp, part)
                    self.plans_flown += 1
                elif event is Event.RESUME:
                    guidance.go_on(stamp)
            self._give_way(stamp, seen)
            self._follow(stamp, decision)
            self.watch_payload()
            if output.state is State.GROUNDED and not output.arm:
                self._wait(state, armed_since is not None)
            elif output.state is State.GROUNDED and armed_since is None:
                if refusal := self._pre_arm.refusal(stamp):  # it is taken back
                    self.give_up(stamp, refusal)
        if self._end is None and self._fell_since < math.inf:
            deadline = self._fell_since + self._parameters.failsafe_timeout
            if armed_since is None or stamp >= deadline:
                self._end = stamp + self._parameters.settle_time
        if self._end is not None:
            output.done = stamp >= self._end
            if output.done:  # the pre-arm report is that of the next flight
                reference, armed = output.reference, armed_since is not None
                self._seen = Observation(state, reference, state[CHI, Z], armed, on_ground=True)
                self._seen.authority = authority or Authority()
                self._seen.readings = readings or Readings()
        return output

    def give_up(self, stamp: float, reason: str) -> None:
        """End a flight before take-off at `stamp` [s]; no effect after take-off."""
        self._follow(stamp, self._supervisor.give_up(stamp, reason))

    def lose_states(self, cause: str) -> None:
        """Hand over to the autopilot's failsafe: states have stopped in flight."""
        self._follow(self._stamp, self._supervisor.lose_states(cause))

    def _wait(self, state: np.ndarray, armed: bool) -> None:
        """Start by itself if it may; in a dry run follow the pose of the first state (3, 6 + n).

        A vehicle that somebody else armed obeys the setpoints in OFFBOARD: no hand check then.
        """
        output = self.output
        if self._start.auto_start and not self._start.dry_run and not self.not_ready:
            self._supervisor.start()
        if self._start.dry_run:
            self._ground_pose.dry_run(output, state)
        else:
            looks = not armed and self._pre_arm.hand_check(self._stamp)
            self._ground_pose.hand_check(output, state, looks)

    def _observe(
        self, stamp: float, state: np.ndarray, armed_since: float | None, readings: Readings
    ) -> Observation:
        p, guidance, armed = self._parameters, self._guidance, armed_since is not None
        if guidance is None:
            seen = Observation(
                state, self.output.reference, self._ground, armed=armed, readings=readings
            )
            started = armed and self.output.arm
            seen.ready = started and stamp >= armed_since + p.takeoff_delay
            seen.on_ground = True
            return seen
        seen, touchdown = self._in_flight, self._touchdown  # a new object takes time
        seen.state, seen.armed, seen.readings, seen.touchdown = state, armed, readings, False
        seen.on_ground = self._is_on_ground(state)
        landing, time = self.scenario.landing, guidance.scenario_time
        seen.end_mission = self._over
        seen.above_stand = self._watch.above_stand(state[CHI])
        seen.off_path = planned = guidance.planned
        seen.landing_due = time >= landing.at and not planned and guidance.goes_on
        seen.arrived = planned and guidance.arrived(stamp)
        if time >= landing.half or touchdown.late_in_descent(stamp):
            if self._odometry:
                stands = supported(state, self.output.reference, p.touchdown_speed)
            else:
                stands = seen.on_ground
            seen.touchdown = touchdown.at_rest(stamp, stands, p)
        seen.overdue = (
            time > landing.end + p.touchdown_timeout or stamp > guidance.end + p.touchdown_timeout
        )
        return seen

    def _since_arrival(self, decision: Decision) -> float:
        """Return for how long [s] a landing seeks the ground, as its reference is at its end."""
        guidance = self._guidance
        if not self._odometry or decision.state is not State.LANDING:
            return 0.0
        if self._touchdown.late_in_descent(self._stamp):
            return self._stamp - guidance.end
        return guidance.scenario_time - self.scenario.landing.end

    def watch_payload(self) -> None:
        """Step the executive of the grasps while the scenario is flown; the end of a `step`."""
        output, watch, stamp, seen = self.output, self._watch, self._stamp, self._seen
        if watch is None or self._parameters.grasp_checks == "off":
            return
        if output.state is not State.FLYING or self._guidance.planned:
            watch.interrupt()
            return
        self._over = self._over or watch.step(stamp, seen.state, seen.readings)
        if decisions := watch.executive.decisions:
            _, output.grasp, output.attempt, output.grasp_text = decisions[-1]

    def _follow(self, stamp: float, decision: Decision) -> None:
        """Apply the supervisor's decision."""
        output = self.output
        if decision.state is not output.state:
            before, output.state = output.state, decision.state
            self._enter(stamp, before, decision)
        if decision.state is State.RELEASED or self._standing is not None:
            self._stow_released(stamp, decision.state is State.RELEASED and decision.stow)
        if self._descent is not None and not self._guidance.fast:
            self._descend(stamp)
        if decision is not self._followed:
            self._followed = decision
            output.cause, output.arm = decision.cause, decision.arm
            output.regains = decision.regains
        output.flying = decision.guide is not Guide.NOTHING  # `GroundPose` writes it, too
        output.phase = self._phase(decision)
        output.magnet = self._magnet_on(decision)

    def _give_way(self, stamp: float, seen: Observation) -> None:
        """Stop and stow the arm where the autopilot comes down by itself; beside a stand it yields.

        A stiff arm on the stand levers the vehicle over. A silent bridge sends no setpoints.
        """
        guidance, held = self._guidance, seen.authority
        heard = stamp - self._resumed > SILENT  # a gap of the ticks is no silence of the bridge
        lands = held.lands or (heard and seen.readings.autopilot_age > SILENT)
        lands = lands and not held.landed and guidance is not None
        flying = self.output.state is State.FLYING  # nobody has stopped it
        if not lands:
            if self._beside is not None and flying:
                guidance.go_on(stamp)
            self._beside = None
            return
        if self._beside is None:
            self._beside = bool(np.any(guidance.clear(guidance.motion[CHI])))
            if flying or self.output.state is State.HOLDING:
                self._stop_to_land(stamp, self._parameters.arm_failsafe == "stow")
        if self._beside:
            guidance.give_way(stamp, seen.state[CHI, ARM])

    def _stop_to_land(self, stamp: float, stow: bool) -> None:
        """Stop, as the autopilot comes down by itself; stow: the arm, before the ground."""
        self._guidance.stop(stamp, stow=False)
        if stow:
            self._guidance.move_arm(stamp, hurry=HURRY)

    def _descend(self, stamp: float) -> None:
        """Descend in an unplanned landing, vertically from the vehicle's position: not on a stand.

        First it moves clear of one that is near, slowly: its setpoints may be late.
        """
        if self._clear_at is None:
            self._clear_at = self._guidance.retreat(stamp)
        if stamp < self._clear_at:
            return
        stow, self._descent = self._descent.stow, None
        self._guidance.descend(stamp, self._seen.state, self._ground, stow)
        self._touchdown.descend(stamp, self._guidance.end)

    def _stow_released(self, stamp: float, stow: bool) -> None:
        """Stow the arm of a released vehicle; a vehicle that stands is not levered up with it."""
        state, standing = self._seen.state, self._standing
        if not stow:
            self._standing = None
        elif standing is None:
            self._standing = Standing()
            self._guidance.stop(stamp, stow)
        elif standing.update(float(state[CHI_DOT, Z])):
            if standing.value:  # where it is now: a way back there would lever, too
                self._guidance.give_way(stamp, state[CHI, ARM])
            else:
                self._guidance.move_arm(stamp)

    def _enter(self, stamp: float, before: State, decision: Decision) -> None:
        state, guidance, event = decision.state, self._guidance, self.changes[-1].event
        if state is State.BLIND and before is State.LANDING:
            return  # it goes on
        self._descent = None
        planned = decision.guide is Guide.SCENARIO or event is Event.TOUCHDOWN
        waits = state in STOPPED_STATES
        self._fell_since = math.inf
        if event is Event.RESUME or (before is State.FAILSAFE and event is Event.AGREES):
            self.output.abort_reason = ""
        elif not waits and not planned and before is not State.FAILSAFE:
            reasons = (self.output.abort_reason, decision.cause)
            self.output.abort_reason = "; then ".join(filter(None, reasons))
        if state is State.TAKING_OFF:
            self._take_off(stamp)
        elif state is State.HOLDING and before in (State.RELEASED, State.FAILSAFE):
            guidance.stay(stamp, self._seen.state, self._ground, self._age)
        elif waits:
            guidance.stop(stamp, decision.stow and event is not Event.ARRIVED)
            self._touchdown.stay()
            if state is State.BLIND:
                guidance.retreat(stamp, hurried=True)
        elif event in (Event.CLEAR, Event.RESTARTED):
            guidance.go_on(stamp)
        elif decision.guide is Guide.DESCEND:
            self._descent, self._clear_at = decision, None
            if before is State.FAILSAFE:
                guidance.stay(stamp, self._seen.state, self._ground, self._age)
            if guidance.fast:
                guidance.stop(stamp, decision.stow, self._parameters.brake_acceleration)
        elif state is State.FAILSAFE:
            self._stop_to_land(stamp, decision.stow)
            self._fell_since = stamp
        elif event is Event.STOPPED:
            self._fell_since = stamp
            self._override.forget()
        elif state is State.DISARMED:
            self._end = stamp + self._parameters.settle_time
            self._override.forget()

    def _take_off(self, stamp: float) -> None:
        start = self._seen.state[0].copy()
        start[3:5] = 0.0
        start[ARM] = self.scenario.arm_start
        self._takeoff, self._ground = stamp, start.item(Z)
        self.scenario = self._planned.begun_at(start)
        self._in_flight = Observation(self._seen.state, self.output.reference, self._ground)
        self._guidance = Guidance(
            self.scenario.trajectory(start),
            stamp,
            self.output.reference,
            self.scenario.arm_start,
            self._parameters,
            self.scenario.landing.end,
        )
        self._watch = PayloadWatch(self.scenario, self._guidance, self._parameters)
        self._guidance.advance(stamp)
        self._guidance.write(stamp)
        self.output.time = 0.0
        self._arrange()

    def _arrange(self) -> None:
        """Called when guidance or parameters of a flight are new."""

    def _is_on_ground(self, state: np.ndarray) -> bool:
        p = self._parameters
        return self._on_ground(state, self._ground, p.touchdown_height, p.touchdown_speed)

    def _phase(self, decision: Decision) -> str:
        if decision.state is State.GROUNDED:
            return WAITING
        if decision.state is State.DISARMED:
            ended = self.changes[-1].event
            return LANDED if ended in (Event.TOUCHDOWN, Event.DISARM_ON_GROUND) else ABORTED
        if decision.state is State.RELEASED:
            return RELEASED
        if self._since_arrival(decision) > 0.0:
            return TOUCHDOWN
        if decision.guide is Guide.SCENARIO:
            if self._guidance.planned:
                return GOAL
            return self.scenario.phase(self._guidance.scenario_time)
        return {Guide.STOP: HOLD, Guide.DESCEND: LAND, Guide.NOTHING: ABORTED}[decision.guide]

    def _scenario_magnet(self) -> bool:
        guidance = self._guidance
        return guidance is not None and self.scenario.magnet_on(guidance.scenario_time)

    def _magnet_on(self, decision: Decision) -> bool:
        """Return the overriding value until the scenario switches, else the scenario's value."""
        watch = self._watch
        desired = self._scenario_magnet() or (watch is not None and watch.executive.directive.grip)
        given = self._override.value(desired)
        if given is not None:
            return given
        down = self._beside or decision.guide is Guide.DESCEND
        if down and watch is not None and watch.standing:
            return False  # the arm would pull on the payload's stand
        left = self.output.grasp in (Grasp.GIVEN_UP, Grasp.ABSENT)
        return desired and decision.keep_magnet and not left
