"""The true coupling force on each subsystem, and the paper's E_j and sigma_j.

Equations (dynamics_p), (dynamics_q), (dynamics_alpha):

    Mbar_j chi_j_ddot + E_j = tau_j
    E_j = (M_jj - Mbar_j) chi_j_ddot + sum_{i != j} M_ji chi_i_ddot + C_j chi_dot + g_j + d_j

Here E_j = H_j + d_j: H_j is what the rigid-body model of the plant says, d_j is the rest. tau_j is
what the law asked for, so d_j holds whatever the actuators do beyond or short of it (rotor lag,
delays, and the integrator of the autopilot's rate loop), friction, drag, contacts and the magnet's
pivot. The weight that is fed forward (law.md, decision 3) is known and no uncertainty: it is taken
out of H_p, so that sigma_j = -Mbar_j^-1 E_j is exactly what (err1) has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import SIZE
from uam_lab.analysis.dynamics import Dynamics
from uam_lab.analysis.supply import COLUMNS_OF, NODE_OF, Supply


@dataclass(frozen=True)
class Coupling:
    """m ticks, all (m, 8); N (p), N m (q, alpha), sigma in m/s^2, rad/s^2."""

    plant: np.ndarray  # H
    rest: np.ndarray  # d
    sigma: np.ndarray  # -Mbar^-1 (H + d)

    def sigma_norm(self, subsystem: str) -> np.ndarray:
        """||sigma_j|| (m,)."""
        return np.linalg.norm(self.sigma[:, COLUMNS_OF[subsystem]], axis=1)


def along(dynamics: Dynamics, acceleration: np.ndarray, supply: Supply, sets: dict) -> Coupling:
    """H, d and sigma from the true dynamics, chi_ddot (m, 8) and what the law asked for."""
    inertia = nominal_inertia(sets)
    required = dynamics.required(acceleration)
    plant = required - inertia * acceleration - supply.weight
    rest = supply.asked - required
    return Coupling(plant, rest, -(plant + rest) / inertia)


def nominal_inertia(sets: dict) -> np.ndarray:
    """The diagonal of Mbar (8,) [kg, kg m^2]."""
    inertia = np.empty(SIZE)
    for name, columns in COLUMNS_OF.items():
        inertia[columns] = sets[NODE_OF[name]].inertia
    return inertia
