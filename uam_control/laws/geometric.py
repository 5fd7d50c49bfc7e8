"""Geometric tracking control, and its L1 augmentation.

Lee, Leok, McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010, with
k = Mbar lambda, so that its feedback compares with that of the other laws:

    tau = Mbar (chi_d_ddot - lambda_1 e - lambda_2 e_dot)

For the attitude e, e_dot and chi_d_ddot are e_R, e_Omega and d/dt (R^T R_d Omega_d) on SO(3), see
`errors`; the gyroscopic term Omega x J Omega is left out, as in the other laws. A joint has no
geometry: there it is PD with feedforward. The weight is added by the position controller.

L1 (after Wu et al., "L1 adaptive augmentation for geometric tracking control of quadrotors", ICRA
2022; the predictor in error coordinates), per axis, with the period T of a tick:

    z = e_dot_hat - e_dot
    sigma_hat = -a e^(-a T) / (1 - e^(-a T)) z            what cancels z within one tick
    e_dot_hat' = tau / Mbar - chi_d_ddot + sigma_hat - a z
    tau gains -Mbar share C(s) sigma_hat,   C(s) = w / (s + w)
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from uam_control.laws.law import GainGroup, Law, LawInputs
from uam_control.laws.law_parameters import LawParameters
from uam_control.maths.compiled import jit
from uam_control.settings.parameter_set import HUGE, TINY, choice, number, vector


@dataclass(frozen=True)
class GeometricParameters(LawParameters):
    """One entry per axis."""

    law: str = choice("geometric", "the law that flies, fixed", ("geometric",), fixed=True)
    inertia: tuple = vector((), "Mbar, its diagonal", "kg or kg m^2", TINY, 1e3)
    lambda_1: tuple = vector((), "lambda_1, gain on e", "1/s^2", TINY, HUGE)
    lambda_2: tuple = vector((), "lambda_2, gain on e_dot", "1/s", TINY, HUGE)

    def linear(self) -> Self:
        """See `LawParameters.linear`; what L1, INDI and the whole-body law adapt is linear."""
        return self


@dataclass(frozen=True)
class GeometricL1Parameters(GeometricParameters):
    """The feedback, and the adaptation on top."""

    law: str = choice("geometric_l1", "the law that flies, fixed", ("geometric_l1",), fixed=True)
    l1_pole: float = number(4.0, "a, pole of the predictor", "1/s", TINY, 1e3)
    l1_cutoff: float = number(2.0, "w, low-pass of what is added", "rad/s", TINY, 1e3)
    l1_share: tuple = vector((1.0,), "part of sigma_hat that is added", "1", 0.0, 1.0)
    l1_limit: float = number(20.0, "largest |sigma_hat|", "m/s^2 or rad/s^2", TINY, HUGE)


@jit
def geometric_step(
    record: np.ndarray, inputs: LawInputs, adaptation: np.ndarray, tau: np.ndarray
) -> None:
    """Write tau (n,), and the norm of the feedback [m/s^2 or rad/s^2] to adaptation (1,)."""
    adaptation[0] = feed_back(record[0], inputs, tau)


@jit
def feed_back(p: np.record, inputs: LawInputs, tau: np.ndarray) -> float:
    """Write tau (n,) of geometric control; return the norm of its feedback."""
    squared = 0.0
    for i in range(len(tau)):
        feedback = p.lambda_1[i] * inputs.e[i] + p.lambda_2[i] * inputs.e_dot[i]
        squared += feedback * feedback
        tau[i] = p.inertia[i] * (inputs.acceleration_d[i] - feedback)
    return math.sqrt(squared)


@jit
def geometric_l1_step(
    record: np.ndarray, inputs: LawInputs, adaptation: np.ndarray, tau: np.ndarray
) -> None:
    """Write tau (n,) and advance adaptation (3 n + 1,): sigma_hat, C sigma_hat, e_dot_hat, begun.

    While the actuator saturates, C sigma_hat does not grow.
    """
    p, n, dt = record[0], len(tau), inputs.dt
    begun = adaptation[3 * n] > 0.0
    decay = math.exp(-p.l1_pole * dt)
    span = (1.0 - decay) / p.l1_pole
    keep = math.exp(-p.l1_cutoff * dt)
    feed_back(p, inputs, tau)
    for i in range(n):
        e_dot = inputs.e_dot[i]
        z = adaptation[2 * n + i] - e_dot if begun else 0.0
        if not inputs.frozen:
            sigma = min(p.l1_limit, max(-p.l1_limit, -decay / span * z))
            added = keep * adaptation[n + i] + (1.0 - keep) * sigma
            if not (inputs.saturated and abs(added) > abs(adaptation[n + i])):
                adaptation[n + i] = added
            adaptation[i] = sigma
        tau[i] -= p.inertia[i] * p.l1_share[i] * adaptation[n + i]
        driven = dt * (tau[i] / p.inertia[i] - inputs.acceleration_d[i])
        adaptation[2 * n + i] = e_dot + decay * z + driven + span * adaptation[i]
    adaptation[3 * n] = 1.0


class GeometricLaw(Law):
    """Geometric tracking control; it adapts nothing. `adaptation` (1,): norm of the feedback."""

    kind = GeometricParameters
    label = "geometric"
    step = geometric_step

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        return (GainGroup("", ("feedback",)),)

    def reset_adaptation(self) -> None:
        """Nothing adapts."""


class GeometricL1Law(Law):
    """Geometric tracking control with L1; `adaptation`: see `geometric_l1_step`."""

    kind = GeometricL1Parameters
    label = "geometric L1"
    memory, per_axis = 1, 1  # whether the predictor has begun; e_dot_hat
    step = geometric_l1_step

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        return (
            GainGroup.of_axes("$\\hat\\sigma$", "sigma", "\\hat\\sigma", axes),
            GainGroup.of_axes("$C\\hat\\sigma$", "filtered", "C\\hat\\sigma", axes),
        )
