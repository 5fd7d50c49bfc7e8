"""What the Appendix assumes and a flight does not quite have: how far off, in numbers.

| assumption | entry |
|---|---|
| M and Mbar close enough that ||sigma|| is not driven by its own tau | `mass_matrix` |
| tau is applied as asked | `saturated` |
| nothing holds the adapted gains down | `at_ceiling`, `safeguards` |
| K_j3 sees ||chi_ddot|| | `acceleration` |
| chi, chi_dot are known | `estimator` |
| e_q_dot is the derivative of e_q, Lambda_j = [lambda_j1 lambda_j2] | `error_rate`, `lambda` |
| zeta_min > 0 | `zeta` |
"""

from __future__ import annotations

from typing import Any

import numpy as np

from uam_control.coordinates import ATTITUDE, POSITION
from uam_control.laws.law_parameters import ModularParameters
from uam_lab.analysis import ticks
from uam_lab.analysis.coupling import nominal_inertia
from uam_lab.analysis.dynamics import Dynamics
from uam_lab.analysis.supply import COLUMNS_OF, NODE_OF, Supply
from uam_lab.analysis.tracking import Tracking
from uam_lab.results.timeseries import Series

AT = 1.0 - 1e-6  # of a limit or ceiling


def mass_matrix(dynamics: Dynamics, sets: dict) -> dict[str, Any]:
    """How far Mbar is from M, the largest along the flight.

    radius: spectral radius of I - M^-1 Mbar for the whole vehicle, free of units; below 1 tau
    feeds back through chi_ddot with a factor below 1. norm: ||I - M_jj Mbar_j^-1|| per subsystem.
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
    """Fraction of the ticks in which tau_j, as recorded, is at one of its limits."""
    force, limits = supply.asked[:, POSITION], sets[NODE_OF["position"]]
    tilted = np.hypot(force[:, 0], force[:, 1]) >= AT * force[:, 2] * np.tan(limits.tilt_max)
    large = np.linalg.norm(force, axis=1) >= AT * limits.thrust_max
    small = force[:, 2] <= limits.thrust_min / AT
    found = {"position": float((tilted | large | small).mean())}
    for name in ("attitude", "arm"):
        most = np.array(sets[NODE_OF[name]].torque_max)
        at = np.abs(supply.asked[:, COLUMNS_OF[name]]) >= AT * most
        found[name] = float(at.any(axis=1).mean())
    return found


def at_ceiling(gains: np.ndarray, ceiling: tuple) -> list[float]:
    """Fraction of the ticks (4,) that each of the gains (m, 4) is held down by its ceiling."""
    limit = np.array(ceiling)
    return np.where(limit > 0.0, np.mean(gains >= AT * limit, axis=0), 0.0).tolist()


def acceleration(
    series: Series, rows: np.ndarray, truth: Tracking, parameters: ModularParameters
) -> dict[str, float]:
    """||chi_ddot|| that K_j3 saw, beside the true one: fraction of ticks below it, its mean, peak.

    The law's limit and low-pass are run again on the recorded estimate, from the first tick on.
    """
    estimate = series.block("estimate.")[:, 16:]
    raw = np.nan_to_num(np.linalg.norm(estimate, axis=1))
    if parameters.acceleration_limit:
        raw = np.minimum(raw, parameters.acceleration_limit)
    if parameters.acceleration_cutoff:
        dt = ticks.period(series)
        keep = np.exp(-2.0 * np.pi * parameters.acceleration_cutoff * dt)
        value = 0.0
        for k in range(len(raw)):
            value = keep * value + (1.0 - keep) * raw[k]
            raw[k] = value
    seen = raw[rows]
    return {
        "below_true": float(np.mean(seen < truth.acceleration)),
        "mean_true": float(truth.acceleration.mean()),
        "mean_seen": float(seen.mean()),
        "peak_true": float(truth.acceleration.max()),
        "peak_seen": float(seen.max()),
    }


def estimator(truth: Tracking, estimate: Tracking) -> dict[str, float]:
    """RMS of ||xi_estimate - xi|| beside that of ||xi||, and how much of it is in e."""
    e, e_dot = estimate.e - truth.e, estimate.e_dot - truth.e_dot
    return {
        "rms_error": float(np.sqrt(np.mean(np.sum(e**2 + e_dot**2, axis=1)))),
        "rms_error_of_e": float(np.sqrt(np.mean(np.sum(e**2, axis=1)))),
        "rms_xi": float(np.sqrt(np.mean(truth.xi**2))),
    }


def error_rate(truth: Tracking) -> float:
    """Largest ||T - I|| of d e_q/dt = T e_q_dot: sin(angle / 2), where ||e_q|| = sin(angle)."""
    sine = np.minimum(np.linalg.norm(truth.e[:, ATTITUDE], axis=1).max(), 1.0)
    return float(np.sin(0.5 * np.arcsin(sine)))


def switches(sets: dict) -> dict[str, Any]:
    """Safeguards that are on, and forms that are not those of the proof, per subsystem."""
    return {
        name: {
            "safeguards": sets[node].safeguards,
            "lambda": sets[node].lambda_form,
            "error_rate_form": sets[node].error_rate_form,
        }
        for name, node in NODE_OF.items()
    }
