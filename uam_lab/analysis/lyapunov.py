"""The Appendix: V_j, its rate of decrease, and the ultimate bound.

    V_j = 1/2 xi_j^T P_j xi_j + sum_i (K_ji - K*_ji)^2 / 2 + zeta_j / zeta_min_j        (lyap_p)
    dV_j/dt <= -rate_j V_j + growth_j                                                    (new2)
    rate_j = min(lambda_min(Q_j), nu_ji) / max(lambda_max(P_j), 1)
    growth_j = rate_j zeta_max_j/zeta_min_j + epsilon_j/zeta_min_j + 1/2 sum_i nu_ji K*_ji^2

and for V = V_p + V_q + V_alpha the same with rate = min rate_j and growth = sum growth_j (new):
V <= max(V(0), B), B = growth / (rate - kappa) for any 0 < kappa < rate. The smallest of these
bounds is the limit kappa -> 0, which is the one used here.

growth holds what new2 has, also where ||r_j|| >= varpi_j and (subs_6p) does without epsilon_j.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uam_control.laws.law_parameters import ModularParameters
from uam_lab.analysis.supply import COLUMNS_OF
from uam_lab.analysis.tracking import Tracking


@dataclass(frozen=True)
class ComparisonSystem:
    """dV/dt <= -rate V + growth [1/s], and what follows from it."""

    rate: float
    growth: float

    @property
    def bound(self) -> float:
        """B, the ultimate bound in the limit kappa -> 0."""
        return self.growth / self.rate

    def envelope(self, start: float, elapsed: np.ndarray) -> np.ndarray:
        """Largest V (m,) that the inequality allows `elapsed` (m,) [s] after V = start."""
        decay = np.exp(-self.rate * elapsed)
        return decay * start + (1.0 - decay) * self.bound

    def __add__(self, other: ComparisonSystem) -> ComparisonSystem:
        """Of the sum of two V_j, equation (new)."""
        return ComparisonSystem(min(self.rate, other.rate), self.growth + other.growth)


@dataclass(frozen=True)
class Parts:
    """The three terms of V_j, each (m,)."""

    tracking: np.ndarray
    gains: np.ndarray
    zeta: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """V_j (m,)."""
        return self.tracking + self.gains + self.zeta


def parts(
    subsystem: str,
    record: np.ndarray,
    truth: Tracking,
    gains: np.ndarray,
    zeta: np.ndarray,
    constants: np.ndarray,
) -> Parts:
    """V_j of one subsystem. record: its law's; gains (m, 4) K_j0..K_j3, zeta (m,), constants K*."""
    columns = COLUMNS_OF[subsystem]
    e, e_dot = truth.e[:, columns], truth.e_dot[:, columns]
    square = e**2 @ record["p11"] + 2.0 * (e * e_dot) @ record["p12"] + e_dot**2 @ record["p22"]
    return Parts(0.5 * square, 0.5 * np.sum((gains - constants) ** 2, axis=1), zeta / np.min(zeta))


def decrease(
    subsystem: str,
    parameters: ModularParameters,
    truth: Tracking,
    gains: np.ndarray,
    zeta: np.ndarray,
    constants: np.ndarray,
) -> np.ndarray:
    """Upper bound of dV_j/dt (m,) before the proof turns it into -rate_j V_j + growth_j.

        -1/2 xi_j^T Q_j xi_j - 1/2 sum_i nu_ji ((K_ji - K*_ji)^2 - K*_ji^2) + epsilon_j / zeta_min_j

    from (subs_4p), whose sum should run to i = 3, and from (new_2) with (subs_3p). Much sharper:
    nothing is divided by lambda_max(P_j).
    """
    columns, nu = COLUMNS_OF[subsystem], np.array(parameters.nu)
    square = truth.e[:, columns] ** 2 @ np.array(parameters.q_position)
    square += truth.e_dot[:, columns] ** 2 @ np.array(parameters.q_velocity)
    pulled = ((gains - constants) ** 2 - constants**2) @ nu
    return -0.5 * (square + pulled) + parameters.epsilon / float(zeta.min())


def comparison(
    parameters: ModularParameters, zeta: np.ndarray, constants: np.ndarray
) -> ComparisonSystem:
    """rate_j and growth_j of one subsystem; its ModularParameters, zeta (m,), constants K*.

    zeta_min and zeta_max are those of the flight.
    """
    record, nu = parameters.record()[0], np.array(parameters.nu)
    smallest_q = min(*parameters.q_position, *parameters.q_velocity)
    rate = min(smallest_q, nu.min()) / max(eigenvalues(record)[1], 1.0)
    low, high = float(zeta.min()), float(zeta.max())
    growth = rate * high / low + parameters.epsilon / low + 0.5 * float(nu @ constants**2)
    return ComparisonSystem(float(rate), float(growth))


def error_bound(record: np.ndarray, value: float) -> float:
    """Largest ||xi_j|| that V_j <= value allows: 1/2 lambda_min(P_j) ||xi_j||^2 <= V_j."""
    return float(np.sqrt(2.0 * value / eigenvalues(record)[0]))


def eigenvalues(record: np.ndarray) -> tuple[float, float]:
    """lambda_min(P), lambda_max(P); P falls apart into a 2 x 2 matrix per axis."""
    middle = 0.5 * (record["p11"] + record["p22"])
    half = np.hypot(0.5 * (record["p11"] - record["p22"]), record["p12"])
    # the product of the two is the determinant; the difference would lose the small one
    large = middle + half
    small = (record["p11"] * record["p22"] - record["p12"] ** 2) / large
    return float(np.min(small)), float(np.max(large))
