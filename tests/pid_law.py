"""Example of an added law: a single file, and its class in `catalogue.LAWS`.

tau = Mbar (chi_d_ddot - lambda_1 e - lambda_2 e_dot - kappa z),   z_dot = e
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uam_control.laws.law import GainGroup, Law, LawInputs
from uam_control.laws.law_parameters import LawParameters
from uam_control.maths.compiled import jit
from uam_control.settings.parameter_set import HUGE, TINY, choice, vector


@dataclass(frozen=True)
class PidParameters(LawParameters):
    """One entry per axis. inertia and lambda are those of the modular law: same name and range."""

    law: str = choice("pid", "the law that flies, fixed", ("pid",), fixed=True)
    inertia: tuple = vector((), "Mbar, its diagonal", "kg or kg m^2", TINY, 1e3)
    lambda_1: tuple = vector((), "lambda_1, gain on e", "1/s^2", TINY, HUGE)
    lambda_2: tuple = vector((), "lambda_2, gain on e_dot", "1/s", TINY, HUGE)
    kappa: tuple = vector((0.5,), "kappa, gain on the integral of e", "1/s^3", 0.0, HUGE)


@jit
def pid_step(
    record: np.ndarray, inputs: LawInputs, adaptation: np.ndarray, tau: np.ndarray
) -> None:
    """One tick of PID: writes tau (n,) and advances adaptation (n,), the integral of e."""
    p = record[0]
    e, e_dot, acceleration_d, norms, saturated, frozen, dt = inputs
    for i in range(len(tau)):
        feedback = p.lambda_1[i] * e[i] + p.lambda_2[i] * e_dot[i] + p.kappa[i] * adaptation[i]
        tau[i] = p.inertia[i] * (acceleration_d[i] - feedback)
        if not frozen and not saturated:
            adaptation[i] += e[i] * dt


class PidLaw(Law):
    """`adaptation` (n,): the integral of e per axis."""

    kind = PidParameters
    label = "PID"
    step = pid_step

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        names = tuple(f"Z{i}" for i in range(1, axes + 1))
        return (GainGroup("$\\int e$", names, "z", signed=True),)

    def reset_adaptation(self) -> None:
        """Forget the integral."""
        self.adaptation[:] = 0.0
