"""Closed-form solution of the Lyapunov equation A^T P + P A = -Q of one subsystem.

The equation stands in the text after eq. (7), err_variable_p; (17), err_variable_q; (24),
err_variable_alpha. With diagonal lambda_1, lambda_2 and Q it splits into n equations of size two,
A = [[0, 1], [-lambda_1, -lambda_2]], Q = diag(q_position, q_velocity).
"""

import numpy as np


def solve(
    lambda_1: np.ndarray, lambda_2: np.ndarray, q_position: np.ndarray, q_velocity: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (p11, p12, p22), each (n,): P = [[diag p11, diag p12], [diag p12, diag p22]] > 0.

    All arguments have shape (n,) and are positive: lambda_1 [1/s^2], lambda_2 [1/s], the two halves
    of Q's diagonal [1]. r of eq. (7), (17), (24) is B^T P xi = p12 e + p22 e_dot.
    """
    p12 = q_position / (2.0 * lambda_1)
    p22 = (q_velocity + 2.0 * p12) / (2.0 * lambda_2)
    p11 = lambda_2 * p12 + lambda_1 * p22
    return p11, p12, p22
