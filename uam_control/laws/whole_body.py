"""Whole-body L1: one law for base, attitude and arm, after FSC-Lab (docs/law.md).

It is flown by `control.whole_body`. What the three subsystems have of their own is here: feedback,
adaptation, parameters. A subsystem that flies alone, as the arm on the ground, has the feedback.

Adaptation, per axis: the rates V of a tick are predicted at the tick before, from all that acts but
the disturbance. What the momentum is beyond the prediction was the disturbance (deadbeat in one
tick, so the predictor's pole cancels). Two low-passes:

    sigma = (p - p_hat) / T
    d' = l1_cutoff (sigma - d),   d_int' = internal_cutoff (sigma - d_int)

The law takes d off force and torque of the base; what moves the hand counts with d_int.
"""

import math
from dataclasses import dataclass

import numpy as np

from uam_control.laws.geometric import GeometricParameters, feed_back
from uam_control.laws.law import GainGroup, Law, LawInputs
from uam_control.maths.compiled import jit
from uam_control.settings.parameter_set import HUGE, TINY, choice, number, vector


@dataclass(frozen=True)
class WholeBodyL1Parameters(GeometricParameters):
    """Feedback and adaptation of a subsystem; `task_...`: of the arm in flight."""

    law: str = choice("whole_body_l1", "the law that flies, fixed", ("whole_body_l1",), fixed=True)
    l1_cutoff: float = number(2.0, "low-pass of the disturbance d", "rad/s", TINY, 1e3)
    internal_cutoff: float = number(
        0.2, "low-pass of the disturbance d_int that the arm counts with", "rad/s", TINY, 1e3
    )
    l1_limit: tuple = vector((20.0,), "largest |d|, |d_int| used", "N or N m", TINY, HUGE)
    task_lambda_1: tuple = vector(
        (200.0, 200.0, 200.0, 5.0), "gain on the hand's x y z and heading", "1/s^2", 0.0, HUGE, 4
    )
    task_lambda_2: tuple = vector(
        (27.0, 27.0, 27.0, 6.0), "gain on the hand's velocity and turning", "1/s", 0.0, HUGE, 4
    )
    task_damping: float = number(
        0.3, "damping of the inverse, for postures near a singular one", "1", TINY, 1e3
    )


@jit
def whole_body_alone(
    record: np.ndarray, inputs: LawInputs, adaptation: np.ndarray, tau: np.ndarray
) -> None:
    """Write tau (n,) of the feedback alone; nothing adapts. See `LawInputs`."""
    feed_back(record[0], inputs, tau)


@jit
def observe(
    p: np.record, moved: np.ndarray, frozen: bool, dt: float, adaptation: np.ndarray
) -> None:
    """Advance d and d_int, the first 2 n values of adaptation (3 n + 1,), by a tick of dt [s].

    moved (n,) [N s or N m s]: momentum beyond the prediction; p: record of the parameters.
    """
    n = len(moved)
    if frozen or adaptation[3 * n] == 0.0:
        return
    for i in range(n):
        for place, cutoff in ((i, p.l1_cutoff), (n + i, p.internal_cutoff)):
            keep = math.exp(-cutoff * dt)
            found = keep * adaptation[place] + (1.0 - keep) * moved[i] / dt
            adaptation[place] = min(p.l1_limit[i], max(-p.l1_limit[i], found))


class WholeBodyL1Law(Law):
    """A subsystem of the law; `adaptation` (3 n + 1,): d, d_int, predicted rates, begun."""

    kind = WholeBodyL1Parameters
    label = "whole-body L1"
    memory, per_axis = 1, 1  # whether the predictor has begun; predicted rates
    step = whole_body_alone
    whole = True

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        return (
            GainGroup.of_axes("$\\hat d$", "d", "\\hat d", axes),
            GainGroup.of_axes("$\\hat d_{int}$", "internal", "\\hat d", axes),
        )
