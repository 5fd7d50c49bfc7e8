"""The modular adaptive law of the paper (Section III), one class for all three subsystems.

Printed equation numbers and labels of the paper, for position, attitude and arm:

    r_j    = B^T P_j xi_j
             (7) err_variable_p, (17) err_variable_q, (24) err_variable_alpha
    tau_j  = Mbar_j (-Lambda_j xi_j - dtau_j + chi_j_d_ddot)
             (8a) tau_p, (18a) tau_q, (25a) tau_alpha
    dtau_j = rho_j r_j / max(||r_j||, varpi_j)
             (8b) del_p, (18b) rho_q, (25b) rho_alpha
    rho_j  = K0 + K1 ||xi|| + K2 ||xi||^2 + K3 ||chi_ddot|| + zeta_j
             (12) rho_p, (21) and (28) without label
    K0..K3 and zeta_j adapted in `adapt`
             (13) adaptive_law_p, (22) adaptive_law_q, (29) adaptive_law_alpha

xi and chi_ddot are those of the whole vehicle; r_j is the subsystem's own. The norms carry the
couplings between the subsystems, so the three parameter sets stay independent.

`bias_gain` mends the law (docs/law.md): dtau_j gains theta_hat_j, one vector per subsystem, see
`adapt_bias`. 0 is the printed law.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from uam_control.laws.law import GainGroup, Law, LawInputs
from uam_control.laws.law_parameters import LawParameters, ceiling
from uam_control.maths.compiled import jit
from uam_control.settings.parameter_set import (
    HUGE,
    TINY,
    ParameterError,
    choice,
    number,
    switch,
    vector,
)

ZETA, RHO, R_NORM, BIAS = 4, 5, 6, 7
ACCELERATION = -1


@dataclass(frozen=True)
class ModularParameters(LawParameters):
    """Design parameters (Table I of the paper) and safeguards; one entry per axis, or K0..K3."""

    law: str = choice("modular", "the law that flies, fixed", ("modular",), fixed=True)
    inertia: tuple = vector((), "Mbar, its diagonal", "kg or kg m^2", TINY, 1e3)
    lambda_1: tuple = vector((), "lambda_1, gain on e", "1/s^2", TINY, HUGE)
    lambda_2: tuple = vector((), "lambda_2, gain on e_dot", "1/s", TINY, HUGE)
    lambda_form: str = choice(
        "theory",
        "theory: Lambda = [lambda_1 lambda_2]; table: lambda_table (e_dot + 2 e); sliding: "
        "lambda_table (e_dot + c e) + c e_dot with c = lambda_1 / lambda_2",
        ("theory", "table", "sliding"),
    )
    lambda_table: tuple = vector(
        (), "Lambda as printed, used by lambda_form: table", "1/s", TINY, HUGE
    )
    q_position: tuple = vector((), "Q, its half on e", "1", TINY, HUGE)
    q_velocity: tuple = vector((), "Q, its half on e_dot", "1", TINY, HUGE)
    k_initial: tuple = vector((), "K0..K3 at the start", "1", TINY, HUGE, 4)
    zeta_initial: float = number(0.01, "zeta at the start", "1", TINY, HUGE)
    nu: tuple = vector((), "leakage nu_0..nu_3 of K0..K3", "1/s", 1e-6, 1e4, 4)
    epsilon: float = number(1e-4, "epsilon, what drives zeta", "1/s", TINY, HUGE)
    varpi: float = number(0.1, "varpi, boundary layer of ||r||", "1", TINY, HUGE)
    k_ceiling: tuple = vector(
        (0.0, 0.0, 0.0, 0.0), "safeguard: largest K0..K3, 0 = off", "1", 0.0, HUGE, 4
    )
    freeze_when_saturated: bool = switch(
        False, "safeguard: K0..K3 do not grow while the actuator saturates"
    )
    acceleration_limit: float = number(
        0.0, "safeguard: largest ||chi_ddot|| used, 0 = off", "m/s^2 or rad/s^2", 0.0, HUGE
    )
    acceleration_cutoff: float = number(
        0.0, "safeguard: low-pass on ||chi_ddot||, 0 = off", "Hz", 0.0, 125.0
    )

    bias_gain: tuple = vector(
        (0.0,), "Gamma of the bias theta_hat, its diagonal; 0 = the printed law", "1/s^2", 0.0, HUGE
    )
    bias_leakage: float = number(0.0, "leakage of theta_hat, 0 = none", "1/s", 0.0, 1e3)
    bias_limit: float = number(3.0, "largest ||theta_hat||", "m/s^2 or rad/s^2", TINY, HUGE)

    adapt_gains: bool = switch(True, "false: K0..K3 and zeta stay, theta_hat alone adapts")

    def linear(self) -> Self:
        """See `LawParameters.linear`; theta_hat is the integral of r: linear."""
        return replace(self, adapt_gains=False)

    def check_together(self) -> None:
        """Raise ParameterError also where the computed matrix P is not positive definite."""
        super().check_together()
        p11, p12, p22 = self.lyapunov_matrix()
        if not np.all((1.0 - 1e-12) * p11 * p22 > p12 * p12):
            raise ParameterError(
                "lambda_1, lambda_2, q_position, q_velocity: together they give a matrix P that "
                "is not positive definite in double precision"
            )

    def lyapunov_matrix(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return p11, p12, p22, each (n,); see `lyapunov_solution`."""
        given = (self.lambda_1, self.lambda_2, self.q_position, self.q_velocity)
        return lyapunov_solution(*map(np.array, given))

    def feedback_gains(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the gains on e [1/s^2] and on e_dot [1/s], each (n,), by `lambda_form`."""
        first, second, table = map(np.array, (self.lambda_1, self.lambda_2, self.lambda_table))
        if self.lambda_form == "theory":
            return first, second
        if self.lambda_form == "table":
            return 2.0 * table, table
        return table * first / second, table + first / second

    def derived(self) -> dict[str, Any]:
        p11, p12, p22 = self.lyapunov_matrix()
        gain_e, gain_e_dot = self.feedback_gains()
        return {
            "gain_e": gain_e,
            "gain_e_dot": gain_e_dot,
            "p11": p11,
            "p12": p12,
            "p22": p22,
            "k_ceiling": ceiling(self.k_ceiling),
            "acceleration_limit": self.acceleration_limit or np.inf,
        }


@jit
def law_step(
    record: np.ndarray, inputs: LawInputs, adaptation: np.ndarray, tau: np.ndarray
) -> None:
    """Compute one tick of the law: write tau (n,) and advance adaptation (8 + n,) in place.

    Equations (7), (8), (12), (13) for the position; (17), (18), (21), (22) for the attitude;
    (24), (25), (28), (29) for the arm.
    """
    p = record[0]
    e, e_dot, acceleration_d, norms, saturated, frozen, dt = inputs
    n = len(tau)

    xi_norm = norms[0]
    acceleration = min(norms[1], p.acceleration_limit)
    if p.acceleration_cutoff > 0.0:
        keep = math.exp(-2.0 * math.pi * p.acceleration_cutoff * dt)
        acceleration = keep * adaptation[ACCELERATION] + (1.0 - keep) * acceleration
    adaptation[ACCELERATION] = acceleration

    # eq. (7), err_variable_p; (17), err_variable_q; (24), err_variable_alpha: ||r_j||
    r_squared = 0.0
    for i in range(n):
        r_i = p.p12[i] * e[i] + p.p22[i] * e_dot[i]
        r_squared += r_i * r_i
    r_norm = math.sqrt(r_squared)

    # eq. (12), rho_p; (21); (28): rho_j, and rho_j without zeta_j
    bound = (
        adaptation[0]
        + adaptation[1] * xi_norm
        + adaptation[2] * xi_norm * xi_norm
        + adaptation[3] * acceleration
    )
    rho = bound + adaptation[ZETA]
    # eq. (8b), del_p; (18b), rho_q; (25b), rho_alpha: dtau_j = scale r_j
    scale = rho / max(r_norm, p.varpi)
    # eq. (8a), tau_p; (18a), tau_q; (25a), tau_alpha
    for i in range(n):
        r_i = p.p12[i] * e[i] + p.p22[i] * e_dot[i]
        feedback = p.gain_e[i] * e[i] + p.gain_e_dot[i] * e_dot[i]
        delta = scale * r_i + adaptation[BIAS + i]
        tau[i] = p.inertia[i] * (acceleration_d[i] - feedback - delta)
    adaptation[RHO] = rho
    adaptation[R_NORM] = r_norm

    if frozen:
        return
    if p.adapt_gains > 0.0:
        adapt(p, r_norm, xi_norm, acceleration, bound, saturated, dt, adaptation)
    adapt_bias(p, e, e_dot, saturated, dt, adaptation[BIAS : BIAS + n])


@jit
def adapt_bias(
    p: np.record, e: np.ndarray, e_dot: np.ndarray, saturated: bool, dt: float, bias: np.ndarray
) -> None:
    """Advance theta_hat_j, bias (n,) [m/s^2 or rad/s^2], by dt [s] in place.

    theta_hat_j' = Gamma_j r_j - leakage theta_hat_j, exact for r_j constant over the tick. On the
    ball ||theta_hat_j|| = bias_limit the part of Gamma_j r_j that points outwards is taken away,
    along Gamma_j theta_hat_j: with V's term 1/2 theta~' Gamma^-1 theta~ this adds nothing to dV/dt
    for a theta_j within the ball (docs/law.md). While the actuator saturates, no entry grows.
    """
    squared = outward = weight = 0.0
    for i in range(len(bias)):
        r_i = p.p12[i] * e[i] + p.p22[i] * e_dot[i]
        squared += bias[i] * bias[i]
        outward += bias[i] * p.bias_gain[i] * r_i
        weight += p.bias_gain[i] * bias[i] * bias[i]
    limit = p.bias_limit
    taken = outward / weight if squared >= limit * limit and outward > 0.0 else 0.0
    keep = math.exp(-p.bias_leakage * dt)
    span = dt if p.bias_leakage * dt < 1e-9 else (1.0 - keep) / p.bias_leakage
    squared = 0.0
    for i in range(len(bias)):
        r_i = p.p12[i] * e[i] + p.p22[i] * e_dot[i]
        following = keep * bias[i] + span * p.bias_gain[i] * (r_i - taken * bias[i])
        if not (saturated and abs(following) > abs(bias[i])):
            bias[i] = following
        squared += bias[i] * bias[i]
    if squared > limit * limit:
        scale = limit / math.sqrt(squared)
        for i in range(len(bias)):
            bias[i] *= scale


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
    """Advance K0..K3 and zeta by dt [s] in place; exact for inputs constant over the tick.

    Eq. (13), adaptive_law_p; (22), adaptive_law_q; (29), adaptive_law_alpha. Each law is linear in
    its own gain, K' = u - nu K. Therefore K(dt) = K e^(-nu dt) + (1 - e^(-nu dt)) u / nu, which
    stays positive for every dt. The Appendix proves the same in continuous time.

    bound: rho_j without zeta_j; acceleration: ||chi_ddot||; adaptation: see `ModularLaw`.
    """
    # eq. (13a), (22a), (29a): K0..K2; (13b), (22b), (29b): K3
    regressor = 1.0
    for i in range(4):
        if i == 3:
            regressor = acceleration
        keep = math.exp(-p.nu[i] * dt)
        gain = keep * adaptation[i] + (1.0 - keep) * r_norm * regressor / p.nu[i]
        if p.freeze_when_saturated > 0.0 and saturated:
            gain = min(gain, adaptation[i])
        # the floor prevents that a decayed gain underflows to zero
        adaptation[i] = max(min(gain, p.k_ceiling[i]), 1e-12)
        regressor *= xi_norm
    # eq. (13c), (22c), (29c): zeta_j, constant for ||r_j|| >= varpi_j
    if r_norm < p.varpi:
        rate = 1.0 + bound * r_norm
        keep = math.exp(-rate * dt)
        adaptation[ZETA] = keep * adaptation[ZETA] + (1.0 - keep) * p.epsilon / rate


class ModularLaw(Law):
    """Modular law; `adaptation` (8 + n,): published gains K0..K3, zeta, rho, ||r||, theta_hat (n,);
    filtered ||chi_ddot||."""

    kind = ModularParameters
    label = "modular"
    profile = "s500"
    memory = 1
    step = law_step

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        return (
            GainGroup("$K_0 \\ldots K_3$", ("K0", "K1", "K2", "K3"), "K"),
            GainGroup("ζ", ("zeta",)),
            GainGroup("ρ", ("rho",)),
            GainGroup("", ("r_norm",)),
            GainGroup.of_axes("$\\hat\\theta$", "bias", "\\hat\\theta", axes),
        )

    @property
    def bias(self) -> np.ndarray:
        return self.adaptation[BIAS:ACCELERATION]

    def reset_adaptation(self) -> None:
        """Set K0..K3 and zeta to their initial values, eq. (13d), zeta1; (22d); (29d)."""
        self.adaptation[:4] = self.parameters.k_initial
        self.adaptation[ZETA] = self.parameters.zeta_initial


def lyapunov_solution(
    lambda_1: np.ndarray, lambda_2: np.ndarray, q_position: np.ndarray, q_velocity: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (p11, p12, p22), each (n,): P = [[diag p11, diag p12], [diag p12, diag p22]] > 0.

    P solves A^T P + P A = -Q of one subsystem, in the text after eq. (7), err_variable_p; (17),
    err_variable_q; (24), err_variable_alpha. With diagonal lambda_1, lambda_2 and Q the equation
    splits into n of size two, A = [[0, 1], [-lambda_1, -lambda_2]], Q = diag(q_position,
    q_velocity).
    All arguments have shape (n,) and are positive: lambda_1 [1/s^2], lambda_2 [1/s], the two halves
    of Q's diagonal [1]. r of eq. (7), (17), (24) is B^T P xi = p12 e + p22 e_dot.
    """
    p12 = q_position / (2.0 * lambda_1)
    p22 = (q_velocity + 2.0 * p12) / (2.0 * lambda_2)
    p11 = lambda_2 * p12 + lambda_1 * p22
    return p11, p12, p22
