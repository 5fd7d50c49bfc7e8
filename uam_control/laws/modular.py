"""The modular adaptive law of the paper (Section III), one class for all three subsystems.

    tau_j  = Mbar_j (-Lambda_j xi_j - dtau_j + chi_j_d_ddot)
    dtau_j = rho_j r_j / max(||r_j||, varpi_j),          r_j = B^T P_j xi_j
    rho_j  = K0 + K1 ||xi|| + K2 ||xi||^2 + K3 ||chi_ddot|| + zeta_j

with the adaptive laws for K0..K3 and zeta_j. xi and chi_ddot are those of the whole vehicle, r_j
the subsystem's own: that is how couplings enter while the three parameter sets stay independent.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.laws.law import Law
from uam_control.laws.law_parameters import ModularParameters
from uam_control.maths.compiled import jit

# what it publishes
ADAPTATION = ("K0", "K1", "K2", "K3", "zeta", "rho", "r_norm")
ZETA, RHO, R_NORM, ACCELERATION = 4, 5, 6, 7


@jit
def law_step(
    record: np.ndarray,
    e: np.ndarray,
    e_dot: np.ndarray,
    acceleration_d: np.ndarray,
    norms: np.ndarray,
    saturated: bool,
    frozen: bool,
    dt: float,
    adaptation: np.ndarray,
    tau: np.ndarray,
) -> None:
    """One tick of the law: writes tau (n,) and advances adaptation (8,) in place.

    Equations (ct1), (del_p), (rho_p) and (adaptive_law_p) of the paper and their twins for q,
    alpha.
    """
    p = record[0]
    n = len(tau)

    xi_norm = norms[0]
    acceleration = min(norms[1], p.acceleration_limit)
    if p.acceleration_cutoff > 0.0:
        keep = math.exp(-2.0 * math.pi * p.acceleration_cutoff * dt)
        acceleration = keep * adaptation[ACCELERATION] + (1.0 - keep) * acceleration
    adaptation[ACCELERATION] = acceleration

    r_squared = 0.0
    for i in range(n):
        r_i = p.p12[i] * e[i] + p.p22[i] * e_dot[i]
        r_squared += r_i * r_i
    r_norm = math.sqrt(r_squared)

    bound = (
        adaptation[0]
        + adaptation[1] * xi_norm
        + adaptation[2] * xi_norm * xi_norm
        + adaptation[3] * acceleration
    )
    rho = bound + adaptation[ZETA]
    scale = rho / max(r_norm, p.varpi)
    for i in range(n):
        r_i = p.p12[i] * e[i] + p.p22[i] * e_dot[i]
        feedback = p.gain_e[i] * e[i] + p.gain_e_dot[i] * e_dot[i]
        tau[i] = p.inertia[i] * (acceleration_d[i] - feedback - scale * r_i)
    adaptation[RHO] = rho
    adaptation[R_NORM] = r_norm

    if frozen:
        return
    adapt(p, r_norm, xi_norm, acceleration, bound, saturated, dt, adaptation)


@jit
def adapt(
    p: np.record,
    r_norm: float,
    xi_norm: float,
    acceleration: float,
    bound: float,
    saturated: bool,
    dt: float,
    adaptation: np.ndarray,
) -> None:
    """Advance K0..K3 and zeta by dt, exactly for inputs that are constant over the tick.

    Each law is linear in its own gain, K' = u - nu K, so K(dt) = K e^(-nu dt) + (1 - e^(-nu dt))
    u/nu stays positive for every dt, as the Appendix proves in continuous time.
    """
    regressor = 1.0
    for i in range(4):
        if i == 3:
            regressor = acceleration
        keep = math.exp(-p.nu[i] * dt)
        gain = keep * adaptation[i] + (1.0 - keep) * r_norm * regressor / p.nu[i]
        if p.freeze_when_saturated > 0.0 and saturated:
            gain = min(gain, adaptation[i])
        # the floor only keeps a decayed gain from underflowing to zero
        adaptation[i] = max(min(gain, p.k_ceiling[i]), 1e-12)
        regressor *= xi_norm
    if r_norm < p.varpi:
        rate = 1.0 + bound * r_norm
        keep = math.exp(-rate * dt)
        adaptation[ZETA] = keep * adaptation[ZETA] + (1.0 - keep) * p.epsilon / rate


class ModularLaw(Law):
    """`adaptation` (8,): K0..K3, zeta, rho, ||r||, and the filtered ||chi_ddot|| that K3 sees."""

    step = law_step

    def __init__(self, parameters: ModularParameters) -> None:
        super().__init__(parameters, ADAPTATION, memory=1)

    def reset_adaptation(self) -> None:
        """Put K0..K3 and zeta back to their initial values."""
        self.adaptation[:4] = self.parameters.k_initial
        self.adaptation[ZETA] = self.parameters.zeta_initial
