"""ASMC-1, a RECONSTRUCTION after Kim et al. 2013 and 2016; their exact law was not available.

Adaptive sliding mode in the form of passivity-based control. Dhat estimates a slowly varying
disturbance and does not depend on the state:

    s = e_dot + Lambda e,   chi_r_dot = chi_d_dot - Lambda e
    tau = Mhat chi_r_ddot + Ghat + Dhat - A s - K sat(s / phi),   Dhat_dot = -Gamma s

with diagonal Mhat, A = a Mhat, K = k Mhat and Gamma = gamma Mhat. The law's own Ghat is 0: the
position controller adds the weight to tau_p for every law (`gravity_feedforward_mass`), and no law
compensates the weight of the arm. For the attitude, e and e_dot are the errors on SO(3), eq. (14)
and (15). These equations are not in the paper.
"""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from uam_control.laws.law import GainGroup, Law, LawInputs
from uam_control.laws.law_parameters import LawParameters
from uam_control.maths.compiled import jit
from uam_control.settings.parameter_set import HUGE, TINY, choice, number, switch, vector


@dataclass(frozen=True)
class Asmc1Parameters(LawParameters):
    """One entry per axis. gamma is one number, the same in all three subsystems."""

    law: str = choice("asmc1", "the law that flies, fixed", ("asmc1",), fixed=True)
    inertia: tuple = vector((), "Mhat, diagonal mass matrix", "kg or kg m^2", TINY, 1e3)
    slope: tuple = vector((), "Lambda, slope of the sliding surface", "1/s", TINY, HUGE)
    damping: tuple = vector((), "a, with A = a Mhat", "1/s", 0.0, HUGE)
    switching: tuple = vector((), "k, with K = k Mhat", "m/s^2 or rad/s^2", 0.0, HUGE)
    boundary: tuple = vector((), "phi, boundary layer of s", "m/s or rad/s", TINY, HUGE)
    switching_form: str = choice(
        "sat", "sat: K sat(s/phi); sign: K sign(s), without boundary layer", ("sat", "sign")
    )
    gamma: float = number(5.0, "gamma, with Gamma = gamma Mhat", "1/s^2", 0.0, HUGE)
    disturbance_ceiling: float = number(
        0.0, "safeguard: largest |Dhat| per axis, 0 = off", "N or N m", 0.0, HUGE
    )
    freeze_when_saturated: bool = switch(
        False, "safeguard: |Dhat| does not grow while the actuator saturates"
    )

    def linear(self) -> Self:
        """See `LawParameters.linear`; Dhat is the integral of s: linear."""
        return self

    def derived(self) -> dict[str, Any]:
        inertia = np.array(self.inertia)
        return {
            "damping": inertia * self.damping,
            "switching": inertia * self.switching,
            "sign": self.switching_form == "sign",
            "gamma": inertia * self.gamma,
            "ceiling": self.disturbance_ceiling or np.inf,
        }


@jit
def asmc1_step(
    record: np.ndarray, inputs: LawInputs, adaptation: np.ndarray, tau: np.ndarray
) -> None:
    """Compute one tick of ASMC-1: write tau (n,) and advance adaptation (n + 1,) in place.

    The derivative of Dhat does not contain Dhat: the sum is exact for s constant over the tick.
    """
    p = record[0]
    e, e_dot, acceleration_d, norms, saturated, frozen, dt = inputs
    n = len(tau)
    squared = 0.0
    for i in range(n):
        s = e_dot[i] + p.slope[i] * e[i]
        squared += s * s
        if p.sign > 0.0:
            switched = np.sign(s)
        else:
            switched = min(max(s / p.boundary[i], -1.0), 1.0)
        tau[i] = (
            p.inertia[i] * (acceleration_d[i] - p.slope[i] * e_dot[i])
            + adaptation[i]
            - p.damping[i] * s
            - p.switching[i] * switched
        )
        if frozen:
            continue
        disturbance = adaptation[i] - p.gamma[i] * s * dt
        if p.freeze_when_saturated > 0.0 and saturated:
            held = abs(adaptation[i])
            disturbance = min(max(disturbance, -held), held)
        adaptation[i] = min(max(disturbance, -p.ceiling), p.ceiling)
    adaptation[n] = math.sqrt(squared)


class Asmc1Law(Law):
    """ASMC-1. `adaptation` (n + 1,): Dhat per axis [N or N m], ||s|| [m/s or rad/s]."""

    kind = Asmc1Parameters
    label = "ASMC-1 (reconstructed)"
    profile = "asmc1"
    step = asmc1_step

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        return (
            GainGroup.of_axes("$\\hat D$", "D", "D", axes),
            GainGroup("‖s‖", ("s_norm",)),
        )

    def reset_adaptation(self) -> None:
        """Set Dhat to zero."""
        self.adaptation[:-1] = 0.0
