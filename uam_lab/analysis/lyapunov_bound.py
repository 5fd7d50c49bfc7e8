"""The Lyapunov function V_j of the Appendix, its rate of decrease, and the ultimate bound.

    V_j = 1/2 xi_j^T P_j xi_j + sum_i (K_ji - K*_ji)^2 / 2 + zeta_j / zeta_min_j   (32), lyap_p
    dV_j/dt <= -rate_j V_j + growth_j                                              (44), new2
    rate_j = min(lambda_min(Q_j), nu_ji) / max(lambda_max(P_j), 1)
    growth_j = rate_j zeta_max_j/zeta_min_j + epsilon_j/zeta_min_j + 1/2 sum_i nu_ji K*_ji^2

For V = V_p + V_q + V_alpha, eq. (31), the same holds with rate = min rate_j and
growth = sum growth_j, eq. (51), new: V <= max(V(0), B), B = growth / (rate - kappa) for any
0 < kappa < rate. The limit kappa -> 0 gives the smallest bound and is used here.

With `bias_gain` (docs/law.md) V_j gains 1/2 theta~_j^T Gamma_j^-1 theta~_j, theta~_j =
theta_hat_j - theta_j, where theta_j is the constant part of sigma_j; K* then bounds sigma_j -
theta_j. In dV_j/dt the new term takes theta~_j^T r_j away that the constant part adds, and
projection adds nothing. Leakage adds 1/2 leakage theta_j^T Gamma_j^-1 theta_j. As for zeta,
growth_j gains rate_j times the largest value of the term: without leakage it has no decrease.

growth contains epsilon_j at every tick, as in eq. (44). Eq. (41), subs_6p, for ||r_j|| >= varpi_j,
has no epsilon_j.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uam_control.laws.modular import ModularParameters
from uam_lab.analysis.supply import COLUMNS_OF
from uam_lab.analysis.tracking import Tracking


@dataclass(frozen=True)
class ComparisonSystem:
    """The comparison equation dV/dt <= -rate V + growth, both in 1/s, and its consequences."""

    rate: float
    growth: float

    @property
    def bound(self) -> float:
        """Return B, the ultimate bound in the limit kappa -> 0."""
        return self.growth / self.rate

    def envelope(self, start: float, elapsed: np.ndarray) -> np.ndarray:
        """Return the largest V (m,) allowed at times `elapsed` (m,) [s] after V = start."""
        decay = np.exp(-self.rate * elapsed)
        return decay * start + (1.0 - decay) * self.bound

    def __add__(self, other: ComparisonSystem) -> ComparisonSystem:
        """Return the comparison equation of the sum of two V_j, eq. (51), new."""
        return ComparisonSystem(min(self.rate, other.rate), self.growth + other.growth)


@dataclass(frozen=True)
class Parts:
    """The terms of V_j, each (m,)."""

    tracking: np.ndarray
    gains: np.ndarray
    zeta: np.ndarray
    bias: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Return V_j (m,)."""
        return self.tracking + self.gains + self.zeta + self.bias


def parts(
    subsystem: str,
    record: np.ndarray,
    truth: Tracking,
    gains: np.ndarray,
    zeta: np.ndarray,
    constants: np.ndarray,
    bias_error: np.ndarray,
) -> Parts:
    """Return V_j of one subsystem, eq. (32) to (34).

    record: parameter record of its law; gains (m, 4): K_j0..K_j3; zeta (m,); constants (4,): K*;
    bias_error (m, n): theta~ [m/s^2 or rad/s^2], axes without `bias_gain` do not count.
    """
    columns = COLUMNS_OF[subsystem]
    e, e_dot = truth.e[:, columns], truth.e_dot[:, columns]
    square = e**2 @ record["p11"] + 2.0 * (e * e_dot) @ record["p12"] + e_dot**2 @ record["p22"]
    found = 0.5 * np.sum((gains - constants) ** 2, axis=1)
    bias = 0.5 * bias_error**2 @ inverse_bias_gain(record)
    return Parts(0.5 * square, found, zeta / np.min(zeta), bias)


def inverse_bias_gain(record: np.ndarray) -> np.ndarray:
    """Return the diagonal of Gamma^-1 (n,) [s^2]; 0 for an axis without bias."""
    gain = record["bias_gain"]
    return np.divide(1.0, gain, out=np.zeros_like(gain), where=gain > 0.0)


def decrease(
    subsystem: str,
    parameters: ModularParameters,
    truth: Tracking,
    gains: np.ndarray,
    zeta: np.ndarray,
    constants: np.ndarray,
    theta: np.ndarray,
) -> np.ndarray:
    """Return an upper bound of dV_j/dt (m,) [1/s], sharper than -rate_j V_j + growth_j.

        -1/2 xi_j^T Q_j xi_j - 1/2 sum_i nu_ji ((K_ji - K*_ji)^2 - K*_ji^2) + epsilon_j / zeta_min_j

    Source: eq. (39), subs_4p, whose sum should run to i = 3, and eq. (42), new_2, with eq. (43),
    subs_3p. It is sharper because it has no division by lambda_max(P_j). Shapes as in `parts`.
    """
    columns, nu = COLUMNS_OF[subsystem], np.array(parameters.nu)
    square = truth.e[:, columns] ** 2 @ np.array(parameters.q_position)
    square += truth.e_dot[:, columns] ** 2 @ np.array(parameters.q_velocity)
    pulled = ((gains - constants) ** 2 - constants**2) @ nu
    steady = parameters.epsilon / float(zeta.min()) + leaking(parameters, theta)
    return -0.5 * (square + pulled) + steady


def leaking(parameters: ModularParameters, theta: np.ndarray) -> float:
    """Return what the leakage of theta_hat adds to dV_j/dt at most [1/s]; theta (n,)."""
    inverse = inverse_bias_gain(parameters.record()[0])
    return 0.5 * parameters.bias_leakage * float(inverse @ theta**2)


def comparison(
    parameters: ModularParameters,
    zeta: np.ndarray,
    constants: np.ndarray,
    theta: np.ndarray,
) -> ComparisonSystem:
    """Return rate_j and growth_j of one subsystem, eq. (44), from zeta (m,), K* (4,), theta (n,).

    zeta_min and zeta_max are the extremes of zeta in this flight. theta_hat is within its ball.
    """
    record, nu = parameters.record()[0], np.array(parameters.nu)
    smallest_q = min(*parameters.q_position, *parameters.q_velocity)
    rate = min(smallest_q, nu.min()) / max(eigenvalues(record)[1], 1.0)
    low, high = float(zeta.min()), float(zeta.max())
    growth = rate * high / low + parameters.epsilon / low + 0.5 * float(nu @ constants**2)
    farthest = parameters.bias_limit + float(np.linalg.norm(theta))
    growth += rate * 0.5 * inverse_bias_gain(record).max() * farthest**2
    growth += leaking(parameters, theta)
    return ComparisonSystem(float(rate), float(growth))


def error_bound(record: np.ndarray, value: float) -> float:
    """Return the largest ||xi_j|| with V_j <= value: 1/2 lambda_min(P_j) ||xi_j||^2 <= V_j."""
    return float(np.sqrt(2.0 * value / eigenvalues(record)[0]))


def eigenvalues(record: np.ndarray) -> tuple[float, float]:
    """Return lambda_min(P), lambda_max(P). P consists of one 2 x 2 matrix per axis."""
    middle = 0.5 * (record["p11"] + record["p22"])
    half = np.hypot(0.5 * (record["p11"] - record["p22"]), record["p12"])
    # product of both eigenvalues = determinant; middle - half would lose digits
    large = middle + half
    small = (record["p11"] * record["p22"] - record["p12"] ** 2) / large
    return float(np.min(small)), float(np.max(large))
