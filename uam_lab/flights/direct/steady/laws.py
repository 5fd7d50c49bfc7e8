"""Position, attitude and arm: errors, law, limits."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from uam_control.control.around_law import (
    ArmArrays,
    AttitudeArrays,
    ControllerArrays,
    PositionArrays,
    begin_attitude,
    begin_law,
    end_arm,
    end_attitude,
    end_position,
)
from uam_control.laws.law import LawInputs
from uam_control.maths.compiled import borrowing, inlined
from uam_control.stages.control_tick import ControlTick
from uam_control.stages.law_stages import apply_reports, step_to
from uam_lab.flights.direct.steady.inputs import InputArrays, keep_gains

Steps = tuple[Callable, Callable, Callable]  # compiled laws of position, attitude and arm


class LawArrays(NamedTuple):
    """Of the three controllers, of their stages (1,), and of the measured delay."""

    position: PositionArrays
    attitude: AttitudeArrays
    arm: ArmArrays
    stages: tuple[np.ndarray, np.ndarray, np.ndarray]
    delay: tuple[np.ndarray, np.ndarray, np.ndarray]


def law_arrays(tick: ControlTick) -> LawArrays:
    """Return the arrays of the laws."""
    laws = tick.position, tick.attitude, tick.arm
    stages = tuple(one.memory for one in laws)
    return LawArrays(*(one.controller.arrays for one in laws), stages, tick.measured_delay.arrays)


@inlined
def given(a: ControllerArrays, dt: float) -> LawInputs:
    """Return what the law gets after a step of dt [s]."""
    m = a.numbers[0]
    return LawInputs(*a.own, a.norms, m.saturated != 0, m.frozen != 0, dt)


@cache
def control(steps: Steps) -> Callable:
    """Return the compiled three controllers; steps: of the laws of position, attitude, arm."""
    position_step, attitude_step, arm_step = steps

    @borrowing
    def control_all(
        a: LawArrays, stamp: int, state: np.ndarray, reference: np.ndarray, inputs: InputArrays
    ) -> bool:
        """Return False, and do nothing, before a law has begun."""
        p, q, r = a.position, a.attitude, a.arm
        if not (p.all.numbers[0].flying and q.all.numbers[0].flying):
            return False
        dt = step_to(a.stages[0], stamp)
        begin_law(p.all, state, reference, p.attitude, True)
        law = p.all.law
        position_step(law.record, given(p.all, dt), law.adaptation, law.tau)
        end_position(p, reference, dt)

        apply_reports(*a.delay, stamp)
        dt = step_to(a.stages[1], stamp)
        begin_attitude(q, state, reference, p.attitude, dt)
        law = q.all.law
        attitude_step(law.record, given(q.all, dt), law.adaptation, law.tau)
        end_attitude(q)

        dt = step_to(a.stages[2], stamp)
        begin_law(r.all, state, reference, p.attitude, True)
        law = r.all.law
        arm_step(law.record, given(r.all, dt), law.adaptation, law.tau)
        end_arm(r, state, reference, dt)

        if a.stages[0][0].gains_due:
            keep_gains(inputs, 0, stamp, p.all.law.adaptation)
        if a.stages[1][0].gains_due:
            keep_gains(inputs, 1, stamp, q.all.law.adaptation)
        if a.stages[2][0].gains_due:
            keep_gains(inputs, 2, stamp, r.all.law.adaptation)
        return True

    return control_all
