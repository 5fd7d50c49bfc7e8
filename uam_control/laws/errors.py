"""Tracking errors of the paper: e, e_dot and ||xi|| of the whole vehicle, eq. (5), err.

The attitude uses the error on SO(3), eq. (14), e_q (no label in the source):
e_q = 1/2 (R_d^T R - R^T R_d)^vee. Its rate has two forms: `lee` (default), Omega - R^T R_d Omega_d,
or `printed`, eq. (15), rate of e_q (no label): q_dot - R_d^T R q_d_dot.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.coordinates import (
    ALPHA,
    CHI,
    CHI_DDOT,
    CHI_DOT,
    PITCH,
    ROLL,
    YAW,
    X,
)
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import (
    matrix_from_euler,
    relative_rotation,
    rotate,
    rotate_back,
)

ERROR_RATE_FORMS = ("lee", "printed")
E, E_DOT, FEEDFORWARD = range(3)  # rows of the errors
XI, ACCELERATION, RATE = range(3)  # ||xi||, ||chi_ddot||, ||chi_dot|| in the norms


@jit
def tracking_errors(
    state: np.ndarray,
    reference: np.ndarray,
    attitude_reference: np.ndarray,
    flying: bool,
    printed: bool,
    errors: np.ndarray,
    norms: np.ndarray,
) -> None:
    """Write eq. (5), err, and the acceleration feedforward into errors (3, 6 + n), norms (3,).

    state, reference: (3, 6 + n), units and frames as in `coordinates`. attitude_reference: (3, 3),
    rows q_d (Euler) [rad], Omega_d [rad/s], Omega_d_dot [rad/s^2] in the desired body frame.
    printed: eq. (15) instead of the `lee` form. errors: rows e, e_dot, chi_d_ddot; while not
    flying, only the arm has errors and the rest is zero. norms: ||xi||, ||chi_ddot||, ||chi_dot||.
    """
    errors[:] = 0.0
    # eq. (5), err: e = chi - chi_d
    for i in range(ALPHA, state.shape[1]):
        errors[E, i] = state[CHI, i] - reference[CHI, i]
        errors[E_DOT, i] = state[CHI_DOT, i] - reference[CHI_DOT, i]
        errors[FEEDFORWARD, i] = reference[CHI_DDOT, i]
    if flying:
        for i in range(X, ROLL):
            errors[E, i] = state[CHI, i] - reference[CHI, i]
            errors[E_DOT, i] = state[CHI_DOT, i] - reference[CHI_DOT, i]
            errors[FEEDFORWARD, i] = reference[CHI_DDOT, i]
        attitude_errors(state, attitude_reference, printed, errors)
    # eq. (5), err: ||xi||, xi = [e, e_dot]
    xi = acceleration = rate = 0.0
    for i in range(state.shape[1]):
        xi += errors[E, i] ** 2 + errors[E_DOT, i] ** 2
        acceleration += state[CHI_DDOT, i] ** 2
        rate += state[CHI_DOT, i] ** 2
    norms[XI] = math.sqrt(xi)
    norms[ACCELERATION] = math.sqrt(acceleration)
    norms[RATE] = math.sqrt(rate)


@jit
def attitude_errors(
    state: np.ndarray, attitude_reference: np.ndarray, printed: bool, errors: np.ndarray
) -> None:
    """Write e_q, its rate and the attitude feedforward into columns ROLL..YAW of errors (3, 6 + n).

    Eq. (14), e_q, and eq. (15), rate of e_q. Arguments as in `tracking_errors`; the results are
    in the body frame (FLU) [1, rad/s, rad/s^2].
    """
    actual = matrix_from_euler(state[CHI, ROLL:ALPHA])
    desired = matrix_from_euler(attitude_reference[CHI])
    relative = relative_rotation(desired, actual)  # R_d^T R
    # eq. (14), e_q
    errors[E, ROLL] = 0.5 * (relative[2, 1] - relative[1, 2])
    errors[E, PITCH] = 0.5 * (relative[0, 2] - relative[2, 0])
    errors[E, YAW] = 0.5 * (relative[1, 0] - relative[0, 1])
    rate = state[CHI_DOT, ROLL:ALPHA]
    rate_d = attitude_reference[CHI_DOT]
    acceleration_d = attitude_reference[CHI_DDOT]
    if printed:  # eq. (15), rate of e_q: q_dot - R_d^T R q_d_dot
        turned = rotate(relative, rate_d)
        for i in range(3):
            errors[E_DOT, ROLL + i] = rate[i] - turned[i]
            errors[FEEDFORWARD, ROLL + i] = acceleration_d[i]
        return
    # in place of eq. (15), the `lee` form: Omega - R^T R_d Omega_d
    turned = rotate_back(relative, rate_d)  # R^T R_d Omega_d
    feedforward = rotate_back(relative, acceleration_d)
    for i in range(3):
        errors[E_DOT, ROLL + i] = rate[i] - turned[i]
    # d/dt (R^T R_d Omega_d) = R^T R_d Omega_d_dot - Omega x (R^T R_d Omega_d)
    errors[FEEDFORWARD, ROLL] = feedforward[0] - (rate[1] * turned[2] - rate[2] * turned[1])
    errors[FEEDFORWARD, PITCH] = feedforward[1] - (rate[2] * turned[0] - rate[0] * turned[2])
    errors[FEEDFORWARD, YAW] = feedforward[2] - (rate[0] * turned[1] - rate[1] * turned[0])
