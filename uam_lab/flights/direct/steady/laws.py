"""Position, attitude and arm: errors, law, limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from uam_control.control.around_law import begin_attitude, end_arm, end_position
from uam_control.control.controllers import (
    ArmController,
    AttitudeController,
    Controller,
    PositionController,
)
from uam_control.control.output_limits import ForceCompletion, limit_torque
from uam_control.coordinates import ALPHA, CHI
from uam_control.laws.errors import tracking_errors
from uam_control.laws.law import LawInputs
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import record
from uam_control.stages.law_stages import GAINS_PERIOD, REPORT_DELAY, LawStage, MeasuredDelay
from uam_control.stamps import SECOND
from uam_control.vehicle import POSITION_SERVO
from uam_lab.flights.direct.steady.inputs import InputArrays, keep_gains


class LawArrays(NamedTuple):
    """State of a controller: record, adaptation and output of its law, errors (3, 6 + n) and rows
    of its own, norms, adapted gains that are published, limited output; memory: WHOLE."""

    record: np.ndarray
    adaptation: np.ndarray
    output: np.ndarray
    errors: np.ndarray
    own: tuple[np.ndarray, np.ndarray, np.ndarray]
    norms: np.ndarray
    published: np.ndarray
    tau: np.ndarray
    memory: np.ndarray


class PositionArrays(NamedTuple):
    """Of the `PositionController`."""

    law: LawArrays
    completion: ForceCompletion
    integral: np.ndarray
    cutoff: float
    filter: np.ndarray
    lead: np.ndarray
    attitude: np.ndarray


class AttitudeArrays(NamedTuple):
    """Of the `AttitudeController`; ahead (3,): prediction now [s], stamp [ns] from which on another
    one counts, and that one [s]."""

    law: LawArrays
    arm: np.ndarray
    loaded: bool
    inertia: float
    ahead: np.ndarray
    washout: np.ndarray
    joints: np.ndarray
    slow: np.ndarray
    torque_max: np.ndarray


class ArmArrays(NamedTuple):
    """Of the `ArmController`; goals: whether the servos are given goal positions."""

    law: LawArrays
    arm: np.ndarray
    loaded: bool
    inertia: np.ndarray
    gain: np.ndarray
    limit: float
    torque_max: np.ndarray
    load: np.ndarray
    integral: np.ndarray
    command: np.ndarray
    goals: bool
    by_reference: bool
    compliance: float
    goal_rate: float
    clock: np.ndarray


Steps = tuple[Callable, Callable, Callable]  # compiled laws of position, attitude and arm
WHOLE = "saturated frozen printed last begun"


class LawPart:
    """The part of a `LawStage`."""

    def __init__(self, stage: LawStage) -> None:
        self.stage = stage
        self.memory = record(WHOLE, "")

    def load(self) -> bool:
        """Copy the state into the arrays; return whether its ticks may be steady."""
        stage, one = self.stage, self.stage.controller
        if not self._flies() or stage._last is None:
            return False
        begun = stage._reported.start
        self.memory[0] = one.saturated, one.law.frozen, one._printed, stage._last, begun
        return True

    def _flies(self) -> bool:
        """Whether the law has begun."""
        return self.stage.controller._flying

    def store(self) -> None:
        """Copy the state back."""
        saturated, _, _, last, begun = self.memory[0].item()
        stage = self.stage
        stage.controller.saturated, stage._last = bool(saturated), last
        stage._reported = range(begun, begun + GAINS_PERIOD)
        stage.gains_due = False

    def arrays(self) -> LawArrays:
        """Return the arrays of the controller."""
        one: Controller = self.stage.controller
        law = one.law
        memory = one._own, one._norms, one.adaptation, one._tau, self.memory
        return LawArrays(law._record, law.adaptation, law._tau, one._errors, *memory)


def position_arrays(part: LawPart) -> PositionArrays:
    """Return the arrays of the position controller."""
    one: PositionController = part.stage.controller
    desired = one._attitude
    return PositionArrays(
        part.arrays(),
        one._completion,
        one._integral,
        float(desired.cutoff),
        desired.filter,
        desired.lead,
        desired.value,
    )


class AttitudePart(LawPart):
    """The part of the attitude's `LawStage`, with the loop delay that is measured."""

    def __init__(self, stage: LawStage, delay: MeasuredDelay) -> None:
        super().__init__(stage)
        self.delay, self.ahead = delay, np.zeros(3)

    def load(self) -> bool:
        """See `LawPart.load`."""
        return super().load() and self._load_ahead()

    def _load_ahead(self) -> bool:
        one: AttitudeController = self.stage.controller
        reports = self.delay.reports
        self.ahead[:] = one._ahead, math.inf, 0.0
        if reports:
            self.ahead[1:] = reports[0][0] + REPORT_DELAY, one.ahead(reports[0][1])
        return len(reports) < 2

    def report(self, stamp: int, loop_delay: float | None) -> bool:
        """Take the report of the tick `stamp` [ns], see `MeasuredDelay.report`; return as `load`
        does."""
        self.delay.apply(stamp)
        self.delay.report(stamp, loop_delay)
        return self._load_ahead()

    def store(self) -> None:
        """See `LawPart.store`."""
        super().store()
        self.delay.apply(self.stage._last)


def attitude_arrays(part: AttitudePart) -> AttitudeArrays:
    """Return the arrays of the attitude controller."""
    one: AttitudeController = part.stage.controller
    p = one.parameters
    return AttitudeArrays(
        part.arrays(),
        one._arm,
        bool(p.arm_feedforward),
        float(p.inertia[1]),
        part.ahead,
        one._washout,
        one._joints,
        one._slow,
        one._torque_max,
    )


class ArmPart(LawPart):
    """The part of the arm's `LawStage`, with the clock of its goals."""

    def __init__(self, stage: LawStage) -> None:
        super().__init__(stage)
        self.clock = np.zeros(2)  # time [s], number of the period of the last goals

    def load(self) -> bool:
        """See `LawPart.load`."""
        one: ArmController = self.stage.controller
        last = one._hold._last
        self.clock[:] = one._time, -1.0 if last is None else last
        return super().load()

    def _flies(self) -> bool:
        return True

    def store(self) -> None:
        """See `LawPart.store`."""
        super().store()
        one: ArmController = self.stage.controller
        time, last = self.clock.tolist()
        one._time, one._hold._last = time, None if last < 0.0 else int(last)

    def arm_arrays(self) -> ArmArrays:
        """Return the arrays of the arm's controller."""
        one: ArmController = self.stage.controller
        p = one.parameters
        return ArmArrays(
            self.arrays(),
            one._arm,
            bool(p.arm_feedforward),
            one._inertia,
            one._integral_gain,
            float(p.integral_limit),
            one._torque_max,
            one._load,
            one._integral,
            one.command,
            p.setpoint == POSITION_SERVO,
            p.goal_from == "reference",
            float(p.goal_compliance),
            float(p.goal_rate),
            self.clock,
        )


@borrowing
def begin_law(a: LawArrays, period: int, stamp: int) -> tuple[float, bool]:
    """Return the time [s] since the last tick, and whether the gains are published at this one."""
    m = a.memory[0]
    elapsed = stamp - m.last
    if not 0 < elapsed <= 10 * period:
        elapsed = period
    m.last = stamp
    due = not m.begun <= stamp < m.begun + GAINS_PERIOD
    if due:
        m.begun = stamp // GAINS_PERIOD * GAINS_PERIOD
    return elapsed / SECOND, due


@cache
def control(steps: Steps) -> Callable:
    """Return the compiled three controllers; steps: of the laws of position, attitude, arm."""
    position_step, attitude_step, arm_step = steps

    @borrowing
    def control_all(
        p: PositionArrays,
        q: AttitudeArrays,
        r: ArmArrays,
        period: int,
        stamp: int,
        state: np.ndarray,
        reference: np.ndarray,
        inputs: InputArrays,
    ) -> None:
        a, m = p.law, p.law.memory[0]
        dt, due = begin_law(a, period, stamp)
        saturated = m.saturated != 0
        tracking_errors(state, reference, p.attitude, True, m.printed != 0, a.errors, a.norms)
        given = LawInputs(*a.own, a.norms, saturated, m.frozen != 0, dt)
        position_step(a.record, given, a.adaptation, a.output)
        m.saturated = end_position(
            *(reference, a.own[0], p.completion, saturated, dt, p.integral, a.output, a.tau),
            *(p.cutoff, p.filter, p.lead, p.attitude),
        )
        if due:
            keep_gains(inputs, 0, stamp, a.published)

        a, m = q.law, q.law.memory[0]
        dt, due = begin_law(a, period, stamp)
        ahead = q.ahead[0] if stamp < q.ahead[1] else q.ahead[2]
        begin_attitude(
            *(state, reference, p.attitude, True, m.printed != 0, q.arm, q.loaded, q.inertia),
            *(ahead, q.washout, dt, a.errors, a.norms, q.joints, q.slow),
        )
        given = LawInputs(*a.own, a.norms, m.saturated != 0, m.frozen != 0, dt)
        attitude_step(a.record, given, a.adaptation, a.output)
        m.saturated = limit_torque(a.output, q.torque_max, a.tau)
        if due:
            keep_gains(inputs, 1, stamp, a.published)

        a, m = r.law, r.law.memory[0]
        dt, due = begin_law(a, period, stamp)
        saturated = m.saturated != 0
        tracking_errors(state, reference, p.attitude, True, m.printed != 0, a.errors, a.norms)
        given = LawInputs(*a.own, a.norms, saturated, m.frozen != 0, dt)
        arm_step(a.record, given, a.adaptation, a.output)
        m.saturated = end_arm(
            *(reference, a.errors, r.arm, r.loaded, r.inertia, r.gain, r.limit, r.torque_max),
            *(saturated, dt, r.load, r.integral, a.output, a.tau),
        )
        if r.goals:
            give_goals(r, dt, reference if r.by_reference else state)
        if due:
            keep_gains(inputs, 2, stamp, a.published)

    return control_all


@borrowing
def give_goals(a: ArmArrays, dt: float, base: np.ndarray) -> None:
    """Renew the goals of servos in position control if they are due; base (3, 6 + n)."""
    a.clock[0] += dt
    if a.goal_rate > 0.0:
        number = int(a.clock[0] * a.goal_rate + 1e-6)
        if number == a.clock[1]:
            return
        a.clock[1] = number
    for i in range(len(a.command)):
        a.command[i] = base[CHI, ALPHA + i] + a.compliance * a.law.tau[i]
