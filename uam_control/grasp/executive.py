"""Executive of grasp and release: it verifies, tries again, gives up, and notices a loss.

It acts on the scenario by three means only: the pace of its clock (1 on, 0 stop, -1 back), a shift
of its path, and a path without the descent. A retreat runs the scenario back, so that the vehicle
leaves payload and stand upwards on the way on which it came.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from uam_control.grasp.alignment import Alignment
from uam_control.grasp.directive import Directive, Grasp, GraspDecision, Step
from uam_control.grasp.evidence import (
    GRIPPERS,
    Evidence,
    GripperKind,
    Load,
    ThrustReserve,
    against,
    by_mass,
    by_pose,
    by_travel,
    expected_throttle,
    fused,
    identified_mass,
    place,
    touches_beside,
)
from uam_control.grasp.grasp_parameters import GraspParameters
from uam_control.grasp.sight import Lasting, RunningMean, Sight
from uam_control.grasp.windows import FROM_ABOVE, GraspWindow

BEFORE = 2.0  # [s] before the descent from which on values are taken
FAR = 2.0  # of the reach: a payload beyond is out of reach without a second look
FALLEN = 0.05  # [m] below its place from which on a payload counts as fallen from its stand
NEAR = 0.015  # [m] height above the payload below which a miss breaks off the descent
BESIDE = 0.5  # [m] horizontal distance from the stand within which a contact is one with it
CONTACT_AFTER = MISSED_AFTER = 0.2  # [s]
LATE = 2.0  # after align_timeout: factor on the tolerances of the alignment, and on the timeout
WEIGHED_FOR = 0.5  # [s] for which an identified mass alone must show the payload: no transient
OVER = 0.05  # [m] horizontal distance from its stand within which it is set down on it
CALM, CALM_FOR = 0.5, 0.5  # of contact_error, and [s] below it, after which a contact is over
PERIOD, CARRY_PERIOD = 0.02, 0.1  # [s] between two steps; away from every stand


class GraspExecutive:
    """Watches the grasps; `lifted`: the payload follows the tool up, before that is a decision."""

    def __init__(
        self, windows: Sequence[GraspWindow], expected: float, parameters: GraspParameters
    ) -> None:
        """windows: see `grasp_windows`; expected [kg]: the scenario's payload."""
        self.parameters = parameters
        self.directive = Directive()
        self.decisions: list[GraspDecision] = []  # all so far
        self.grasp, self.lifted = Grasp.NONE, False  # newest state
        self._windows, self._expected = list(windows), expected
        self._step, self._since = Step.IDLE, 0.0
        self._attempt = 0
        self._alignment = Alignment()
        self._load, self._before = RunningMean(), Load()
        self._stood = np.full(3, math.nan)  # grip point of the standing payload
        self._start = np.zeros(3)  # tool at the begin of the descent
        self._gripped = np.full((2, 3), math.nan)  # tool and payload at the grip
        self._lasting, self._contact = Lasting(), Lasting()  # of a condition; of a contact
        self._reserve, self._too_heavy = ThrustReserve(), False  # found out
        self._shift_of_lift = np.zeros(3)  # of the path
        self.period = PERIOD  # [s] until the next step
        self._steps: dict[Step, Callable[[Sight, GraspWindow], None]] = {
            Step.APPROACH: self._approach,
            Step.ALIGN: self._align,
            Step.DESCEND: self._descend,
            Step.LIFT: self._lift,
            Step.VERIFY: self._verify,
            Step.RETREAT: self._retreat,
            Step.CLIMB: self._climb,
            Step.CARRY: self._carry,
            Step.RELEASE: self._release,
        }

    @property
    def aligns_for(self) -> GraspWindow | None:
        """Return the window whose descent has not begun, None without one."""
        before = self._step in (Step.IDLE, Step.APPROACH, Step.ALIGN)
        return self._windows[0] if before and self._windows else None

    @property
    def point(self) -> tuple[float, float, float]:
        """Where the present window's payload is gripped (3,) [m], see `Approach`."""
        return self._windows[0].approach.point if self._windows else FROM_ABOVE.point

    @property
    def due_from(self) -> float:
        """The scenario time [s] from which on a window is near; inf without one."""
        if self._step is not Step.IDLE:  # a retreat may pass the begin
            return -math.inf
        return self._windows[0].descent - BEFORE if self._windows else math.inf

    def step(self, sight: Sight) -> Directive:
        """Return the directive after `sight`; call it while the scenario is flown.

        Off the path nothing is aligned; contacts are noticed.
        """
        if not self._windows:
            return self.directive
        window = self._windows[0]
        if self._step is Step.IDLE:
            self._go(Step.APPROACH, sight)
        if not sight.on_path and self._step in (Step.APPROACH, Step.ALIGN):
            self.interrupt()
            return self.directive
        self._since = min(self._since, sight.stamp)
        self._load.add(sight.stamp, np.array([sight.lift, sight.effort]))
        self._reserve.add(sight, self.parameters)
        self.period = PERIOD
        self._steps[self._step](sight, window)
        return self.directive

    def interrupt(self) -> None:
        """Forget running values and the time waited: the scenario is not flown now."""
        self._since = math.inf  # until the next step
        for one in (self._alignment, self._load, self._lasting, self._contact, self._reserve):
            one.restart()

    def _go(self, step: Step, sight: Sight, pace: float = 1.0) -> None:
        self._step, self._since = step, sight.stamp
        self._lasting.restart()
        self._contact.restart()
        self.lifted = self.lifted and step is Step.VERIFY
        self.directive.pace = pace
        self.directive.grip = self.directive.grip and step in (Step.DESCEND, Step.LIFT)

    def _decide(self, sight: Sight, grasp: Grasp, text: str) -> None:
        self.grasp = grasp
        self.decisions.append(GraspDecision(sight.stamp, grasp, self._attempt, text))

    def _waited(self, sight: Sight) -> float:
        return sight.stamp - self._since

    def _approach(self, sight: Sight, window: GraspWindow) -> None:
        self._alignment.add(sight, window)
        p, alignment = self.parameters, self._alignment
        if sight.time < window.descent:
            if alignment.near(p.align_range):
                shift = self.directive.shift
                self.directive.shift = alignment.correction(shift, p, p.align_tolerance)
            return
        self._stood, self._start = sight.payload.copy(), sight.tool.copy()
        beyond = sight.tracked and alignment.known and not alignment.near(self._reach)
        if beyond and not alignment.near(FAR * self._reach):
            self._leave_out(sight, window)
        elif beyond:
            alignment.restart()  # above the payload it is measured once more
            self._go(Step.ALIGN, sight, pace=0.0)
        elif alignment.good(p):
            self._begin_descent(sight, window)
        else:
            self._go(Step.ALIGN, sight, pace=0.0)

    def _align(self, sight: Sight, window: GraspWindow) -> None:
        p, alignment = self.parameters, self._alignment
        alignment.add(sight, window)
        late = self._waited(sight) >= p.align_timeout
        first_look = sight.tracked and not self._attempt
        if first_look and alignment.known and not alignment.near(self._reach):
            if alignment.settled():
                self._leave_out(sight, window)
        elif alignment.good(p) or (late and alignment.good(p, LATE)):
            self._begin_descent(sight, window)
        elif late and (alignment.known or self._waited(sight) >= LATE * p.align_timeout):
            self._attempt += 1
            seen = alignment.text if alignment.known else "payload seen at times only"
            self._decide(sight, Grasp.APPROACHED, f"no descent, {seen}")
            self._again_or_give_up(sight, window)
        else:
            self.directive.shift = alignment.correction(self.directive.shift, p)

    @property
    def _reach(self) -> float:
        """Largest distance [m] of a payload from its place at which it is approached."""
        return max(self.parameters.align_range, self.parameters.descent_miss)

    def _leave_out(self, sight: Sight, window: GraspWindow) -> None:
        """Fly on without a payload that is not in its place."""
        self._attempt += 1
        text = f"absent, not within {self._reach:g} m of its place"
        self._leave(sight, window, Grasp.ABSENT, f"{text}; payload at {place(sight.payload)}")

    def _begin_descent(self, sight: Sight, window: GraspWindow) -> None:
        throttle = expected_throttle(sight, self._expected)
        if throttle > self.parameters.pick_throttle:
            text = f"given up, too heavy: thrust {throttle:.2f} with {self._expected:g} kg"
            self._leave(sight, window, Grasp.GIVEN_UP, text)
            return
        self._attempt += 1
        self._stood, self._start = sight.payload.copy(), sight.tool.copy()
        self._before = self._present_load()
        self._decide(sight, Grasp.APPROACHED, f"descent, {self._alignment.text}")
        self._go(Step.DESCEND, sight)

    def _descend(self, sight: Sight, window: GraspWindow) -> None:
        p = self.parameters
        if self._touches(sight):
            self._leave_contact(sight)
        elif sight.tracked and self._misses(sight, window.approach.axes):
            self._go_back(sight, f"broken off, {by_pose(sight, p).text}")
        elif sight.tracked and self._gripper.early and not self.directive.grip:
            self.directive.grip = touches_beside(sight, self._grip_tolerance)
        if self._step is Step.DESCEND and sight.time >= window.grip:
            self._gripped[:] = sight.tool_then, sight.payload
            self._shift_of_lift = self.directive.shift
            self._go(Step.LIFT, sight)

    @property
    def _carries(self) -> bool:
        return self.grasp in (Grasp.HELD, Grasp.UNVERIFIED)

    @property
    def _gripper(self) -> GripperKind:
        return GRIPPERS[self.parameters.gripper]

    @property
    def _grip_tolerance(self) -> float:
        """Distance [m] beside the payload from which it is gripped at contact."""
        return self.parameters.align_tolerance if self._attempt == 1 else 0.0

    def _misses(self, sight: Sight, axes: np.ndarray) -> bool:
        """Return whether the tool is near and beside the payload, or the payload has fallen; axes:
        see `Approach.axes`."""
        away = axes @ (sight.payload - sight.tool)
        beside = bool(np.hypot(*away[:2]) > self.parameters.descent_miss)
        low = (axes @ (sight.tool - self._stood))[2] < NEAR
        fallen = bool(self._stood[2] - sight.payload[2] > FALLEN)
        return fallen or self._lasting(sight.stamp, bool(low and beside)) >= MISSED_AFTER

    def _present_load(self) -> Load:
        return Load(*self._load.mean) if len(self._load.mean) else Load()

    def _mass(self, sight: Sight) -> Evidence:
        mass = identified_mass(self._before, self._present_load(), sight.lever)
        return by_mass(mass, self._expected, self.parameters)

    def _felt(self, sight: Sight) -> Evidence:
        return self._gripper.held(sight, self.parameters)

    def _lift(self, sight: Sight, window: GraspWindow) -> None:
        if self._touches(sight):
            self._leave_contact(sight)
            return
        pose = against(by_travel(sight, *self._gripped, self.parameters), self._felt(sight))
        self.lifted = pose.held is True
        if self._reserve.short:
            self._set_down(sight)
        elif self._lasting(sight.stamp, pose.held is False) >= MISSED_AFTER:
            self._go_back(sight, f"not held, {pose.text}")
        elif sight.time >= window.lifted:
            self._go(Step.VERIFY, sight)
            self._verify(sight, window)

    def _verify(self, sight: Sight, window: GraspWindow) -> None:
        if self._touches(sight):  # held down: a payload that cannot be lifted
            error = _across(sight.error)
            self._go_back(sight, f"not lifted, position error {error:.2f} m")
            return
        if self._reserve.short:
            self._set_down(sight)
            return
        pose = by_travel(sight, *self._gripped, self.parameters)
        evidence = fused(sight, pose, self._felt(sight), self._mass(sight))
        lasts = self._lasting(sight.stamp, bool(evidence.held))
        lasted = lasts >= (0.0 if sight.tracked else WEIGHED_FOR)
        if evidence.held and lasted and self._load.span(sight.stamp) > 0.0:
            self._begin_carry(sight, Grasp.HELD, evidence.text)
        elif evidence.held is False and sight.tracked:
            self._go_back(sight, f"not held, {evidence.text}")
        elif self._waited(sight) < self.parameters.lift_timeout:
            self.directive.pace = 0.0
        elif sight.tracked and self._mass(sight).held:  # near the tool, and its weight is there
            self._begin_carry(sight, Grasp.HELD, evidence.text)
        elif evidence.held is False or sight.tracked:
            self._go_back(sight, f"not held, {evidence.text}")
        else:
            self._begin_carry(sight, Grasp.UNVERIFIED, evidence.text)

    def _begin_carry(self, sight: Sight, grasp: Grasp, text: str) -> None:
        self._decide(sight, grasp, text)
        self._go(Step.CARRY, sight)
        self.directive.shift = np.zeros(3)

    def _set_down(self, sight: Sight) -> None:
        """Put the payload back on its stand, by the way on which it came."""
        self._too_heavy, self.directive.shift = True, self._shift_of_lift
        self._go_back(sight, f"too heavy, thrust {sight.throttle:.2f}: set down")

    def _go_back(self, sight: Sight, text: str) -> None:
        self._decide(sight, Grasp.APPROACHED, text)
        self._go(Step.RETREAT, sight, pace=-1.0)

    def _retreat(self, sight: Sight, window: GraspWindow) -> None:
        if sight.time <= window.descent:
            self._again_or_give_up(sight, window)

    def _again_or_give_up(self, sight: Sight, window: GraspWindow) -> None:
        """Align once more, or leave the payload where it is."""
        p, reason = self.parameters, ""
        self._alignment.restart()
        if self._too_heavy:
            reason, self._too_heavy = "too heavy", False
        elif sight.tracked and self._stood[2] - sight.payload[2] > FALLEN:
            reason = "fallen from its place"
        elif sight.tracked and np.hypot(*(sight.payload - self._start)[:2]) > FAR * self._reach:
            reason = "out of reach"
        elif self._attempt >= p.grasp_attempts:
            reason = f"{self._attempt} approaches"
        if not reason:
            self._go(Step.ALIGN, sight, pace=0.0)
            return
        where = f"; payload at {place(sight.payload)}" if sight.tracked else ""
        self._leave(sight, window, Grasp.GIVEN_UP, f"given up, {reason}{where}")

    def _leave(self, sight: Sight, window: GraspWindow, grasp: Grasp, text: str) -> None:
        """Leave the payload where it is: go on without the descent, or land. A path without an
        approach from the side would come too near to what stands there: it lands."""
        self._decide(sight, grasp, text)
        self.directive = Directive(without_descent=window)
        if self.parameters.grasp_given_up == "land" or not window.approach.from_above:
            self.directive.land = self.decisions[-1].text
        self._end()

    def _end(self) -> None:
        """Leave the window."""
        self._windows.pop(0)
        self._step, self._attempt = Step.IDLE, 0
        self._alignment.restart()

    def _touches(self, sight: Sight) -> bool:
        """Return whether the arm has had contact with the stand for CONTACT_AFTER."""
        beyond = _across(sight.error) > self.parameters.contact_error
        return self._contact(sight.stamp, beyond) >= CONTACT_AFTER

    def _leave_contact(self, sight: Sight) -> None:
        error = _across(sight.error)
        text = f"contact near the stand, position error {error:.2f} m: climbs"
        self._decide(sight, self.grasp, text)
        self._go(Step.CLIMB, sight, pace=0.0)
        self.directive.shift = self.directive.shift + [0.0, 0.0, self.parameters.contact_climb]

    def _climb(self, sight: Sight, window: GraspWindow) -> None:
        p = self.parameters
        calm = float(np.linalg.norm(sight.error)) < CALM * p.contact_error
        lasts = self._lasting(sight.stamp, calm)
        if self._waited(sight) < p.align_timeout and lasts < CALM_FOR:
            return
        if self._carries:
            self._go(Step.CARRY, sight)
        else:
            self._go(Step.RETREAT, sight, pace=-1.0)

    def _carry(self, sight: Sight, window: GraspWindow) -> None:
        p = self.parameters
        if sight.time >= window.release:
            self._go(Step.RELEASE, sight)
            return
        away = _across(sight.tool - self._start)
        beside = away < BESIDE
        if self._carries and self._reserve.short and away < OVER:
            self._set_down(sight)
            return
        if not beside and sight.time < window.release - CARRY_PERIOD:
            self.period = CARRY_PERIOD
        if beside and self._touches(sight):
            self._leave_contact(sight)
            return
        if not beside and self.directive.shift.any():
            self.directive.shift = np.zeros(3)
        if not self._carries:
            return
        if not beside and self._reserve.sinks(sight) and not self.directive.land:
            self._decide(sight, self.grasp, f"too heavy, thrust {sight.throttle:.2f}: lands")
            self.directive.land = self.decisions[-1].text
        evidence = against(by_pose(sight, p), self._felt(sight))  # not the mass: the arm moves
        if self._lasting(sight.stamp, evidence.held is False) >= p.lost_after:
            self._decide(sight, Grasp.LOST, f"lost in flight, {evidence.text}")
            if p.payload_lost == "land":
                self.directive.land = self.decisions[-1].text

    def _release(self, sight: Sight, window: GraspWindow) -> None:
        p = self.parameters
        pose = by_pose(sight, p)
        gone = pose.held is False or self._gripper.let_go(sight, p)
        if not self._carries:
            self._end()
        elif gone:
            if sight.time >= window.departure or self.directive.pace == 0.0:
                self._decide(sight, Grasp.RELEASED, f"released, payload at {place(sight.payload)}")
                self.directive.pace = 1.0
                self._end()
        elif sight.time >= window.departure:
            self.directive.pace = 0.0
            if not sight.tracked:
                self.directive.pace = 1.0
                self._decide(sight, Grasp.RELEASED, "released, not verified")
                self._end()
            elif self._waited(sight) >= p.release_timeout + window.departure - window.release:
                self.directive.pace = 1.0
                self._decide(sight, Grasp.STUCK, f"not released, {pose.text}")
                self._end()


def _across(way: np.ndarray) -> float:
    """Return the horizontal length [m] of way (3,)."""
    return math.hypot(way.item(0), way.item(1))
