"""The true coupling force on each subsystem, and the paper's E_j and sigma_j.

Eq. (6), dynamics_p; (16), dynamics_q; (23), dynamics_alpha:

    Mbar_j chi_j_ddot + E_j = tau_j
    E_j = (M_jj - Mbar_j) chi_j_ddot + sum_{i != j} M_ji chi_i_ddot + C_j chi_dot + g_j + d_j

Here E_j = H_j + d_j. H_j comes from the rigid-body model of the plant, d_j is the remainder. tau_j
is the command of the law, so d_j contains the difference between command and actuators (rotor
lag, delays, integrator of the autopilot's rate loop), friction, drag, contacts and the pivot of
the magnet. What tau_j has of known loads (`Supply.known`: the weight, the arm's links) is no
uncertainty: H_j does not contain it, and sigma_j = -Mbar_j^-1 E_j is the sigma_j of eq. (9), err1.
"""

from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ALPHA
from uam_lab.analysis.dynamics import Dynamics
from uam_lab.analysis.supply import COLUMNS_OF, NODE_OF, Supply


@dataclass(frozen=True)
class Coupling:
    """Coupling forces at m ticks, all (m, 8): N, world (p), N m, FLU (q), N m (alpha)."""

    plant: np.ndarray  # H
    rest: np.ndarray  # d
    sigma: np.ndarray  # -Mbar^-1 (H + d): m/s^2 (p), rad/s^2 (q, alpha)

    def sigma_norm(self, subsystem: str) -> np.ndarray:
        """Return ||sigma_j|| (m,) [m/s^2 or rad/s^2]."""
        return np.linalg.norm(self.sigma[:, COLUMNS_OF[subsystem]], axis=1)


def along(dynamics: Dynamics, acceleration: np.ndarray, supply: Supply, sets: dict) -> Coupling:
    """Return H, d and sigma from the true dynamics, the true chi_ddot (m, 8) and tau."""
    plant = coupling_force(dynamics, acceleration, sets) - supply.known
    rest = supply.tau - dynamics.required(acceleration)
    return Coupling(plant, rest, -(plant + rest) / nominal_inertia(sets))


def coupling_force(dynamics: Dynamics, acceleration: np.ndarray, sets: dict) -> np.ndarray:
    """Return H with the known loads (m, 6 + n), for the true chi_ddot (m, 6 + n)."""
    return dynamics.required(acceleration) - nominal_inertia(sets) * acceleration


def nominal_inertia(sets: dict) -> np.ndarray:
    """Return the diagonal of Mbar (6 + n,) [kg (p), kg m^2 (q, alpha)]."""
    inertia = np.empty(ALPHA + len(sets[NODE_OF["arm"]].inertia))
    for name, columns in COLUMNS_OF.items():
        inertia[columns] = sets[NODE_OF[name]].inertia
    return inertia
