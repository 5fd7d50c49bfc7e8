"""Incremental nonlinear dynamic inversion (INDI).

After Smeur, Chu, de Croon, "Adaptive incremental nonlinear dynamic inversion for attitude control
of micro air vehicles", JGCD 2016, in error coordinates and with a given effectiveness 1/Mbar:

    nu = chi_d_ddot - lambda_1 e - lambda_2 e_dot
    tau = tau_f + Mbar (nu - chi_ddot_f),   chi_ddot_f = (d/dt e_dot)_f + chi_d_ddot_f

_f: one low-pass of first order for all, so that the torque of before is compared with what it has
done. What disturbs, stays in tau_f: no integral of the error. It needs actuators that make tau as
it is: of the attitude, the setpoint type `wrench`.
"""

import math
from dataclasses import dataclass

import numpy as np

from uam_control.laws.geometric import GeometricParameters
from uam_control.laws.law import GainGroup, Law, LawInputs
from uam_control.maths.compiled import jit
from uam_control.settings.parameter_set import choice, number


@dataclass(frozen=True)
class IndiParameters(GeometricParameters):
    """The feedback, and the low-pass."""

    law: str = choice("indi", "the law that flies, fixed", ("indi",), fixed=True)
    indi_cutoff: float = number(3.0, "low-pass of torque and acceleration", "Hz", 0.01, 100.0)


@jit
def indi_step(
    record: np.ndarray, inputs: LawInputs, adaptation: np.ndarray, tau: np.ndarray
) -> None:
    """Write tau (n,) and advance adaptation (4 n + 1,): tau_f; tau, e_dot_f, chi_d_ddot_f, begun.

    While the actuator saturates, tau_f does not grow: it is not what the actuator makes.
    """
    p, n, dt = record[0], len(tau), inputs.dt
    part = 1.0 - math.exp(-2.0 * math.pi * p.indi_cutoff * dt)
    begun = adaptation[4 * n] > 0.0
    for i in range(n):
        e_dot, feedforward = inputs.e_dot[i], inputs.acceleration_d[i]
        if not begun:
            adaptation[2 * n + i], adaptation[3 * n + i] = e_dot, feedforward
        slope = part * (e_dot - adaptation[2 * n + i]) / dt
        adaptation[2 * n + i] += slope * dt
        adaptation[3 * n + i] += part * (feedforward - adaptation[3 * n + i])
        following = adaptation[i] + part * (adaptation[n + i] - adaptation[i])
        if not inputs.frozen and not (inputs.saturated and abs(following) > abs(adaptation[i])):
            adaptation[i] = following
        nu = feedforward - p.lambda_1[i] * inputs.e[i] - p.lambda_2[i] * e_dot
        tau[i] = adaptation[i] + p.inertia[i] * (nu - slope - adaptation[3 * n + i])
        adaptation[n + i] = tau[i]
    adaptation[4 * n] = 1.0


class IndiLaw(Law):
    """INDI; `adaptation`: see `indi_step`."""

    kind = IndiParameters
    label = "INDI"
    memory, per_axis = 1, 3  # whether the filters have begun; tau, e_dot_f, chi_d_ddot_f
    step = indi_step

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        return (GainGroup.of_axes("$\\tau_f$", "tau_f", "\\tau", axes),)
