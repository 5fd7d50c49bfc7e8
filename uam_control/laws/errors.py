"""Tracking errors of the paper: e, e_dot and ||xi|| of the whole vehicle, eq. (5), err.

The attitude uses the error on SO(3), eq. (14), e_q (no label in the source):
e_q = 1/2 (R_d^T R - R^T R_d)^vee. Its rate has two forms: `lee` (default), Omega - R^T R_d Omega_d,
or `printed`, eq. (15), rate of e_q (no label): q_dot - R_d^T R q_d_dot.
"""

import math

import numpy as np

from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, PITCH, ROLL, YAW, X
from uam_control.maths.compiled import borrowing
from uam_control.maths.rotations import rows_from_euler
from uam_control.maths.vectors import cross, minus, product, transposed, turned, vector, write

ERROR_RATE_FORMS = ("lee", "printed")
E, E_DOT, FEEDFORWARD = range(3)  # rows of the errors
XI, ACCELERATION, RATE = range(3)  # ||xi||, ||chi_ddot||, ||chi_dot|| in the norms


@borrowing
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


@borrowing
def attitude_errors(
    state: np.ndarray, attitude_reference: np.ndarray, printed: bool, errors: np.ndarray
) -> None:
    """Write e_q, its rate and the attitude feedforward into columns ROLL..YAW of errors (3, 6 + n).

    Eq. (14), e_q, and eq. (15), rate of e_q. Arguments as in `tracking_errors`; the results are
    in the body frame (FLU) [1, rad/s, rad/s^2].
    """
    q, q_d = state[CHI], attitude_reference[CHI]
    actual = rows_from_euler(q[ROLL], q[PITCH], q[YAW])
    back = transposed(rows_from_euler(q_d[0], q_d[1], q_d[2]))
    relative = product(back, actual)  # R_d^T R
    # eq. (14), e_q
    errors[E, ROLL] = 0.5 * (relative[2][1] - relative[1][2])
    errors[E, PITCH] = 0.5 * (relative[0][2] - relative[2][0])
    errors[E, YAW] = 0.5 * (relative[1][0] - relative[0][1])
    rate = vector(state[CHI_DOT, ROLL:ALPHA])
    rate_d = vector(attitude_reference[CHI_DOT])
    acceleration_d = vector(attitude_reference[CHI_DDOT])
    if printed:  # eq. (15), rate of e_q: q_dot - R_d^T R q_d_dot
        write(minus(rate, turned(relative, rate_d)), errors[E_DOT, ROLL:ALPHA])
        write(acceleration_d, errors[FEEDFORWARD, ROLL:ALPHA])
        return
    # in place of eq. (15), the `lee` form: Omega - R^T R_d Omega_d
    relative = transposed(relative)
    moving = turned(relative, rate_d)  # R^T R_d Omega_d
    write(minus(rate, moving), errors[E_DOT, ROLL:ALPHA])
    # d/dt (R^T R_d Omega_d) = R^T R_d Omega_d_dot - Omega x (R^T R_d Omega_d)
    feedforward = minus(turned(relative, acceleration_d), cross(rate, moving))
    write(feedforward, errors[FEEDFORWARD, ROLL:ALPHA])
