"""The paper's unknown constants K*_j0..K*_j3 in the bound of ||sigma_j||, computed from a flight.

Eq. (11), up_bound_p; (20), up_bound_q; (27), up_bound_alpha:

    ||sigma_j|| <= K*0 + K*1 ||xi|| + K*2 ||xi||^2 + K*3 ||chi_ddot||

The proof holds for any constants that satisfy the bound at every tick. `smallest` minimises
sum nu_i K*_i^2, and with it the ultimate bound. `from_the_paper` evaluates the expressions below
eq. (11), products of norms, which are much larger.
"""

import numpy as np

from uam_control.laws.modular import ModularParameters
from uam_lab.analysis.coupling import Coupling, nominal_inertia
from uam_lab.analysis.dynamics import Dynamics
from uam_lab.analysis.supply import COLUMNS_OF, Supply
from uam_lab.analysis.tracking import Tracking

SLOWEST = 0.05  # ||chi_dot||; below it rounding dominates C chi_dot / ||chi_dot||^2


def regressor(truth: Tracking) -> np.ndarray:
    """Return 1, ||xi||, ||xi||^2, ||chi_ddot|| (m, 4), the factors of K*0..K*3 in eq. (11)."""
    xi = truth.xi
    return np.column_stack([np.ones_like(xi), xi, xi**2, truth.acceleration])


def steady(sigma: np.ndarray, parameters: ModularParameters) -> np.ndarray:
    """Return theta_j (n,), what theta_hat_j can take of sigma (m, n) [m/s^2 or rad/s^2].

    The mean of the flight, within the ball of `bias_limit`, for the axes with `bias_gain`.
    """
    found = np.where(np.array(parameters.bias_gain) > 0.0, sigma.mean(axis=0), 0.0)
    length = float(np.linalg.norm(found))
    return found * min(1.0, parameters.bias_limit / length) if length else found


def smallest(sigma: np.ndarray, regressors: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """Return K* (4,) >= 0 of least sum nu_i K*_i^2 with regressors @ K* >= sigma at every tick.

    sigma (m,) is ||sigma_j|| [m/s^2 or rad/s^2], regressors (m, 4), nu (4,). A least-distance
    problem, solved after Lawson and Hanson by non-negative least squares: with y = sqrt(nu) K*,
    the solution of min ||y|| subject to G y >= h is y = -s[:4] / s[4], where s is the residual of
    NNLS on [G^T; h^T] u = (0, 0, 0, 0, 1).
    """
    from scipy.optimize import nnls  # the import takes half a second; `uam --help` skips it

    scale = float(np.max(sigma))
    if scale <= 0.0:
        return np.zeros(4)
    root = np.sqrt(nu)
    constraints = np.vstack([regressors / root, np.eye(4)])
    least = np.concatenate([sigma / scale, np.zeros(4)])
    system = np.vstack([constraints.T, least])
    target = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    try:
        weights, _ = nnls(system, target, maxiter=30 * system.shape[1])
    except RuntimeError:  # no convergence: K*0 alone is also a bound
        return np.array([scale, 0.0, 0.0, 0.0])
    residual = system @ weights - target
    found = np.maximum(scale * -residual[:4] / residual[4] / root, 0.0)
    # scale up, so that the bound holds at every tick despite rounding
    return found * max(1.0, float(np.max(sigma / np.maximum(regressors @ found, 1e-12))))


def from_the_paper(
    subsystem: str,
    dynamics: Dynamics,
    coupling: Coupling,
    supply: Supply,
    truth: Tracking,
    sets: dict,
) -> np.ndarray:
    """Return K* (4,) from the expressions below eq. (11), each norm the largest of the flight.

    g_bar is the bound of g minus the known loads; d_bar is the bound of `coupling.rest`.
    """
    columns = COLUMNS_OF[subsystem]
    inertia = nominal_inertia(sets)[columns]
    inverse = float(np.max(1.0 / inertia))
    gravity = np.linalg.norm((dynamics.gravity - supply.known)[:, columns], axis=1).max()
    rest = np.linalg.norm(coupling.rest[:, columns], axis=1).max()
    moving = truth.rate > SLOWEST
    coriolis = 0.0
    if moving.any():
        force = np.linalg.norm(dynamics.coriolis[moving, columns], axis=1)
        coriolis = np.max(force / truth.rate[moving] ** 2)
    rate = truth.reference_rate.max()
    own = _norm(dynamics.mass[:, columns, columns] - np.diag(inertia))
    others = [
        _norm(dynamics.mass[:, columns, other])
        for name, other in COLUMNS_OF.items()
        if name != subsystem
    ]
    return inverse * np.array(
        [
            gravity + rest + coriolis * rate**2,
            2.0 * coriolis * rate,
            coriolis,
            own + sum(others),
        ]
    )


def _norm(matrices: np.ndarray) -> float:
    """Return the largest 2-norm of matrices (m, a, b)."""
    return float(np.linalg.norm(matrices, ord=2, axis=(1, 2)).max())
