"""How far a flight departs from the assumptions of the Appendix, in numbers.

| assumption | entry |
|---|---|
| M and Mbar are close enough that tau does not drive ||sigma|| | `mass_matrix` |
| the actuators apply tau without saturation | `saturated` |
| no safeguard limits the adapted gains | `at_ceiling`, `safeguards` |
| the true ||chi_ddot|| multiplies K_j3 in rho_j, eq. (12), rho_p | `acceleration` |
| chi and chi_dot are known without error | `estimator` |
| e_q_dot is the derivative of e_q, Lambda_j = [lambda_j1 lambda_j2] | `error_rate`, `lambda` |
| zeta_min > 0 | `zeta` |
"""

from typing import Any

import numpy as np

from uam_control.coordinates import ATTITUDE, POSITION
from uam_control.laws.modular import ModularParameters
from uam_lab.analysis import tracking
from uam_lab.analysis.coupling import nominal_inertia
from uam_lab.analysis.dynamics import Dynamics
from uam_lab.analysis.supply import COLUMNS_OF, NODE_OF, Supply
from uam_lab.analysis.tracking import Tracking
from uam_lab.records.results.timeseries import Series

AT = 1.0 - 1e-6  # of a limit or ceiling


def mass_matrix(dynamics: Dynamics, sets: dict) -> dict[str, Any]:
    """Return the largest distance between Mbar and M along the flight.

    radius: spectral radius of I - M^-1 Mbar of the whole vehicle, dimensionless; if it is below
    1, tau feeds back through chi_ddot with a factor below 1. norm: ||I - M_jj Mbar_j^-1|| per
    subsystem. m_smallest, m_largest: eigenvalues of M, Property 1.
    """
    inertia, mass = nominal_inertia(sets), dynamics.mass
    identity = np.eye(mass.shape[1])
    whole = np.linalg.eigvals(
        identity - np.linalg.solve(mass, np.broadcast_to(np.diag(inertia), mass.shape))
    )
    norms = {}
    for name, columns in COLUMNS_OF.items():
        own = mass[:, columns, columns] / inertia[columns]
        distance = np.linalg.norm(np.eye(own.shape[1]) - own, ord=2, axis=(1, 2))
        norms[name] = float(distance.max())
    eigenvalues = np.linalg.eigvalsh(mass)
    return {
        "radius": float(np.abs(whole).max()),
        "norm": norms,
        "m_smallest": float(eigenvalues.min()),
        "m_largest": float(eigenvalues.max()),
    }


def saturated(supply: Supply, sets: dict) -> dict[str, float]:
    """Return, per subsystem, the fraction of the ticks with the recorded tau_j at a limit."""
    force, limits = supply.tau[:, POSITION], sets[NODE_OF["position"]]
    tilted = np.hypot(force[:, 0], force[:, 1]) >= AT * force[:, 2] * np.tan(limits.tilt_max)
    large = np.linalg.norm(force, axis=1) >= AT * limits.thrust_max
    small = force[:, 2] <= limits.thrust_min / AT
    found = {"position": float((tilted | large | small).mean())}
    for name in ("attitude", "arm"):
        most = np.array(sets[NODE_OF[name]].torque_max)
        at = np.abs(supply.tau[:, COLUMNS_OF[name]]) >= AT * most
        found[name] = float(at.any(axis=1).mean())
    return found


def at_ceiling(gains: np.ndarray, ceiling: tuple) -> list[float]:
    """Return the fraction of the ticks (4,) with each gain K0..K3 (m, 4) at its ceiling (4,)."""
    limit = np.array(ceiling)
    return np.where(limit > 0.0, np.mean(gains >= AT * limit, axis=0), 0.0).tolist()


def acceleration(
    series: Series, rows: np.ndarray, truth: Tracking, parameters: ModularParameters
) -> dict[str, float]:
    """Compare ||chi_ddot|| in rho_j with the true value at `rows` (m,): mean, peak.

    below_true: fraction of the ticks with the law's value below the true one. The law's limit and
    low-pass are applied again to the recorded estimate, from the first tick on.
    """
    from scipy.signal import lfilter  # the import takes half a second; `uam --help` skips it

    estimate = series.block("estimate.")[:, 2 * series.columns.size :]
    raw = np.nan_to_num(np.linalg.norm(estimate, axis=1))
    if parameters.acceleration_limit:
        raw = np.minimum(raw, parameters.acceleration_limit)
    if parameters.acceleration_cutoff:
        dt = tracking.period(series)
        keep = np.exp(-2.0 * np.pi * parameters.acceleration_cutoff * dt)
        raw = lfilter([1.0 - keep], [1.0, -keep], raw)
    seen = raw[rows]
    return {
        "below_true": float(np.mean(seen < truth.acceleration)),
        "mean_true": float(truth.acceleration.mean()),
        "mean_seen": float(seen.mean()),
        "peak_true": float(truth.acceleration.max()),
        "peak_seen": float(seen.max()),
    }


def estimator(truth: Tracking, estimate: Tracking) -> dict[str, float]:
    """Return the RMS of ||xi_estimate - xi||, of its e part, and of ||xi||."""
    e, e_dot = estimate.e - truth.e, estimate.e_dot - truth.e_dot
    return {
        "rms_error": float(np.sqrt(np.mean(np.sum(e**2 + e_dot**2, axis=1)))),
        "rms_error_of_e": float(np.sqrt(np.mean(np.sum(e**2, axis=1)))),
        "rms_xi": float(np.sqrt(np.mean(truth.xi**2))),
    }


def error_rate(truth: Tracking) -> float:
    """Return the largest ||T - I|| of d e_q/dt = T e_q_dot: sin(angle/2), ||e_q|| = sin(angle)."""
    sine = np.minimum(np.linalg.norm(truth.e[:, ATTITUDE], axis=1).max(), 1.0)
    return float(np.sin(0.5 * np.arcsin(sine)))


def switches(sets: dict) -> dict[str, Any]:
    """Return the active safeguards and the forms of Lambda and of e_q_dot, per subsystem."""
    return {
        name: {
            "safeguards": sets[node].safeguards,
            "lambda": sets[node].lambda_form,
            "error_rate_form": sets[node].error_rate_form,
        }
        for name, node in NODE_OF.items()
    }
