"""ASMC-2, a RECONSTRUCTION after Liang et al. 2023; its exact law was not available.

Prescribed performance and adaptive sliding mode. The law needs the mass matrix, but no bound of
the disturbance:

    rho_i = (rho_i0 - rho_iinf) exp(-l_i t) + rho_iinf, eta = e / rho,
    epsilon = 0.5 ln((1 + eta) / (1 - eta)),            R = diag(1 / (rho (1 - eta^2)))
    v = e rho_dot / rho,   epsilon_dot = R (e_dot - v), s = epsilon_dot + kappa epsilon,   w = R s
    tau = Ghat + Mhat [chi_d_ddot + v_dot - R^-1 (R_dot (e_dot - v) + kappa epsilon_dot)
          - k_s R^-1 s - (theta^T Y) w / (||w|| + varpi)],      Y = [1, ||chi_dot||, ||chi_dot||^2]
    theta_dot = gamma (||w|| Y - sigma theta)

t starts at the reset of the law: at take-off; for the arm, when its controller starts on the
ground. |eta| is clamped at 0.98 in every term (e then counts as 0.98 rho). The law counts the
clamped axes of all ticks. Mhat is diagonal; Ghat, and the errors of the attitude: as in `asmc1`.
These equations are not in the paper.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from uam_control.laws.law import GainGroup, Law, LawInputs
from uam_control.laws.law_parameters import LawParameters, ceiling
from uam_control.maths.compiled import jit
from uam_control.settings.parameter_set import HUGE, TINY, choice, number, switch, vector

ETA_MAX = 0.98
W_NORM, ETA, CLAMPS, TIME = 3, 4, 5, 6


@dataclass(frozen=True)
class Asmc2Parameters(LawParameters):
    """One entry per axis, or theta_0..theta_2. gamma is the same in all three subsystems."""

    law: str = choice("asmc2", "the law that flies, fixed", ("asmc2",), fixed=True)
    inertia: tuple = vector((), "Mhat, diagonal mass matrix", "kg or kg m^2", TINY, 1e3)
    rho_initial: tuple = vector((), "rho_0, error allowed at the start", "m or rad", 1e-3, 1e3)
    rho_final: tuple = vector((), "rho_inf, error allowed in the end", "m or rad", 1e-3, 1e3)
    rho_rate: tuple = vector((), "l, rate from rho_0 to rho_inf", "1/s", 0.0, 1e3)
    kappa: tuple = vector((), "kappa, slope of the sliding surface", "1/s", TINY, 1e4)
    surface_gain: tuple = vector((), "k_s, gain on s", "1/s", 0.0, 1e4)
    theta_initial: tuple = vector(
        (0.01, 0.01, 0.01), "theta_0..theta_2 at the start", "1", 0.0, HUGE, 3
    )
    gamma: float = number(1.0, "gamma, rate of adaptation", "1", TINY, 1e4)
    sigma: float = number(1.0, "sigma, leakage of theta: gamma sigma theta", "1", 1e-6, HUGE)
    varpi: float = number(1.0, "varpi, softens w / ||w||", "1", TINY, HUGE)
    theta_ceiling: tuple = vector(
        (0.0, 0.0, 0.0), "safeguard: largest theta_0..theta_2, 0 = off", "1", 0.0, HUGE, 3
    )
    freeze_when_saturated: bool = switch(
        False, "safeguard: theta does not grow while the actuator saturates"
    )

    def derived(self) -> dict[str, Any]:
        return {"theta_ceiling": ceiling(self.theta_ceiling)}


@jit
def asmc2_step(
    record: np.ndarray, inputs: LawInputs, adaptation: np.ndarray, tau: np.ndarray
) -> None:
    """Compute one tick of ASMC-2: write tau (n,) and advance adaptation (7,) in place."""
    p = record[0]
    e, e_dot, acceleration_d, norms, saturated, frozen, dt = inputs
    n = len(tau)
    time = adaptation[TIME]
    adaptation[TIME] = time + dt
    w = np.empty(n)
    largest = squared = 0.0
    for i in range(n):
        fading = (p.rho_initial[i] - p.rho_final[i]) * math.exp(-p.rho_rate[i] * time)
        rho = fading + p.rho_final[i]
        rho_dot = -p.rho_rate[i] * fading
        rho_ddot = -p.rho_rate[i] * rho_dot
        eta = e[i] / rho
        largest = max(largest, abs(eta))
        if abs(eta) > ETA_MAX:
            eta = math.copysign(ETA_MAX, eta)
            adaptation[CLAMPS] += 1.0
        slope = 1.0 / (rho * (1.0 - eta * eta))  # R
        relative = e_dot[i] - eta * rho_dot  # e_dot - v
        # d/dt (e rho_dot / rho)
        v_dot = e_dot[i] * rho_dot / rho + eta * (rho_ddot - rho_dot * rho_dot / rho)
        # R^-1 R_dot = -R d/dt (rho (1 - eta^2)), and rho eta_dot = e_dot - v
        slope_rate = -slope * (rho_dot * (1.0 - eta * eta) - 2.0 * eta * relative)
        kappa_epsilon = p.kappa[i] * 0.5 * math.log((1.0 + eta) / (1.0 - eta))
        s = slope * relative + kappa_epsilon
        w[i] = slope * s
        squared += w[i] * w[i]
        tau[i] = (
            acceleration_d[i]
            + v_dot
            - slope_rate * relative
            - p.kappa[i] * relative  # R^-1 kappa epsilon_dot
            - p.surface_gain[i] * s / slope
        )
    w_norm = math.sqrt(squared)
    rate = norms[2]
    gain = adaptation[0] + adaptation[1] * rate + adaptation[2] * rate * rate
    scale = gain / (w_norm + p.varpi)
    for i in range(n):
        tau[i] = p.inertia[i] * (tau[i] - scale * w[i])
    adaptation[W_NORM] = w_norm
    adaptation[ETA] = largest
    if not frozen:
        adapt(p, w_norm, rate, saturated, dt, adaptation)


@jit
def adapt(
    p: np.record, w_norm: float, rate: float, saturated: bool, dt: float, adaptation: np.ndarray
) -> None:
    """Advance theta, adaptation[:3] of (7,), by dt [s]; exact for inputs constant over the tick.

    theta' = gamma (u - sigma theta) is linear in theta, so theta >= 0 holds for every dt.
    rate: ||chi_dot||; w_norm: ||w||.
    """
    keep = math.exp(-p.gamma * p.sigma * dt)
    regressor = 1.0
    for i in range(3):
        theta = keep * adaptation[i] + (1.0 - keep) * w_norm * regressor / p.sigma
        if p.freeze_when_saturated > 0.0 and saturated:
            theta = min(theta, adaptation[i])
        adaptation[i] = min(theta, p.theta_ceiling[i])
        regressor *= rate


class Asmc2Law(Law):
    """ASMC-2. `adaptation` (7,): theta_0..theta_2, ||w||, largest |eta|, clamp count, time [s]."""

    kind = Asmc2Parameters
    label = "ASMC-2 (reconstructed)"
    profile = "asmc2"
    memory = 1
    step = asmc2_step

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        return (
            GainGroup("$\\theta_0 \\ldots \\theta_2$", ("theta0", "theta1", "theta2"), "\\theta"),
            GainGroup("‖w‖", ("w_norm",)),
            GainGroup("largest |η|", ("eta",)),
            GainGroup("", ("clamps",)),
        )

    def reset_adaptation(self) -> None:
        """Set theta to its initial value; the time since the start of the law continues."""
        self.adaptation[:3] = self.parameters.theta_initial
