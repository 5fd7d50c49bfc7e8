"""The arm takes out at the hand what the base leaves: a correction of the arm's reference.

The hand of the reference is compared with that of the present base and of the corrected arm. The
least change of the joints that closes the difference, by the damped Jacobian (Nakamura and Hanafusa
1986), is approached with `hand_bandwidth`. Only the commanded angles are used, not the measured
ones: the arm's own errors stay with its law.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.hand import hand_in_world
from uam_control.arm.kinematics import hand_jacobian
from uam_control.coordinates import ALPHA, ATTITUDE, CHI, CHI_DOT, ROLL, X
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.rotations import matrix_from_euler
from uam_control.maths.vectors import (
    Vector,
    cross,
    dot,
    minus,
    rows,
    times,
    transposed,
    turned,
    vector,
)
from uam_control.settings.parameter_set import ParameterSet, number

FADE = 0.5  # [s] in which the correction comes and goes
RETURN = 4.0  # [rad/s] bandwidth of the way back to the reference, without a bandwidth of its own
INSIDE = 0.1  # [rad] of the end of a joint's range; the supervisor holds up to 0.05 before it
# freedom: directions in which the hand moves; why: see FADES. REAL: parameters, weight, period [s]
WHOLE = "has_hand freedom why"
# why the correction fades out, as text
FADES = STEERS, IDLE, SINGULAR, FAR = range(4)
TEXTS = {
    STEERS: "",
    IDLE: "on the ground, released, or in failsafe",
    SINGULAR: "near a singular posture: hand_singular",
    FAR: "the hand is too far off: hand_error_max",
}


@dataclass(frozen=True)
class HandParameters(ParameterSet):
    """How the arm stabilises the hand."""

    hand_bandwidth: float = number(
        0.0, "bandwidth with which the arm keeps the hand where it shall be, 0 = none", "rad/s",
        0.0, 50.0,
    )  # fmt: skip
    hand_damping: float = number(
        0.01, "damping of the hand's Jacobian, for postures near a singular one", "m/rad", 1e-4, 1.0
    )
    hand_joint_rate: float = number(
        1.0, "largest rate that a joint is given for it", "rad/s", 0.0, 20.0
    )
    hand_error_max: float = number(
        0.1,
        "error of the hand beyond which the arm gives up until it is below again",
        "m",
        0.0,
        1.0,
    )
    hand_singular: float = number(
        0.01, "motion of the hand in its hardest direction, below which the arm gives up", "m/rad",
        0.0, 1.0,
    )  # fmt: skip


REAL = " ".join((*HandParameters.specs(), "weight", "period"))


class HandArrays(NamedTuple):
    """State of the stabilisation of the hand."""

    chain: Chain
    ranges: np.ndarray  # (2, n) [rad]
    correction: np.ndarray  # (2, n) angles [rad] and rates
    pose: np.ndarray  # (6 + n,) for the computation
    jacobian: np.ndarray  # (6, n) for the computation
    reference: np.ndarray  # (3, 6 + n) of the arm law
    numbers: np.ndarray  # (1,) WHOLE, REAL


@jit
def steer(
    h: HandArrays, state: np.ndarray, reference: np.ndarray, flying: bool, saturated: bool
) -> None:
    """Write the reference of the arm law, corrected, to h.reference.

    state, reference: (3, 6 + n), the reference with the attitude that its acceleration needs;
    saturated: whether a limit changes the torques, so that the correction stays as it is.
    """
    m, count = h.numbers[0], h.correction.shape[1]
    dt = m.period
    h.reference[:] = reference
    if m.has_hand == 0 or (
        m.hand_bandwidth == 0.0 and m.weight == 0.0 and not h.correction[0].any()
    ):
        return
    error, away = _error(h, state, reference)
    square = squared(h.jacobian)
    m.why = _why(h, flying, away, square)
    wanted = m.hand_bandwidth > 0.0 and m.why == STEERS
    m.weight = min(1.0, m.weight + dt / FADE) if wanted else max(0.0, m.weight - dt / FADE)
    if m.weight > 0.0 and away <= m.hand_error_max:
        goal = _least(h, error, square, m.hand_damping)
    else:
        goal = (0.0, 0.0, 0.0)
    bandwidth = m.hand_bandwidth if wanted else max(m.hand_bandwidth, RETURN)
    for i in range(count):
        target = m.weight * dot(vector(h.jacobian[:3, i]), goal)
        now, angle = h.correction[0, i], reference[CHI, ALPHA + i]
        rate = min(m.hand_joint_rate, max(-m.hand_joint_rate, bandwidth * (target - now)))
        # a reference that is near the end of its range stays there
        low, high = min(0.0, h.ranges[0, i] - angle), max(0.0, h.ranges[1, i] - angle)
        after = min(high, max(low, now + rate * dt))
        if saturated and wanted:
            after = now
        if not wanted and m.weight == 0.0 and abs(after) < 1e-6:
            after = 0.0
        h.correction[0, i], h.correction[1, i] = after, (after - now) / dt
        h.reference[CHI, ALPHA + i] += after
        h.reference[CHI_DOT, ALPHA + i] += h.correction[1, i]


@borrowing
def _why(h: HandArrays, flying: bool, away: float, square: np.ndarray) -> int:
    """Return which of FADES counts, for a hand that is `away` [m] from its place; square: see
    `squared`."""
    m = h.numbers[0]
    if not flying:
        return IDLE
    if away > m.hand_error_max:
        return FAR
    return SINGULAR if hardest(square, m.freedom) < m.hand_singular else STEERS


@jit
def squared(jacobian: np.ndarray) -> np.ndarray:
    """Return J J^T (3, 3) of the place's rows of jacobian (6, n)."""
    square = np.zeros((3, 3))
    for i in range(jacobian.shape[1]):
        for j in range(3):
            for k in range(3):
                square[j, k] += jacobian[j, i] * jacobian[k, i]
    return square


@borrowing
def hardest(square: np.ndarray, freedom: int) -> float:
    """Return how far the hand moves in its hardest direction [m/rad], at least.

    square (3, 3): J J^T; freedom: in how many directions it moves. Of the eigenvalues of J J^T, the
    smallest that counts is at least the ratio of two elementary symmetric polynomials of them.
    """
    a, b, c = rows(square)
    first = a[0] + b[1] + c[2]
    second = a[0] * b[1] - a[1] * b[0] + a[0] * c[2] - a[2] * c[0] + b[1] * c[2] - b[2] * c[1]
    if freedom < 2 or first <= 0.0:
        return math.sqrt(max(0.0, first))
    if freedom == 2 or second <= 0.0:
        return math.sqrt(max(0.0, second / first))
    return math.sqrt(max(0.0, dot(a, cross(b, c)) / second))


@jit
def _error(h: HandArrays, state: np.ndarray, reference: np.ndarray) -> tuple[Vector, float]:
    """Return where the hand should be from where it is, in the base frame [m], and the distance.

    Writes the Jacobian of the corrected arm.
    """
    count = h.correction.shape[1]
    wanted, _ = hand_in_world(h.chain, reference[CHI])
    h.pose[:] = state[CHI]
    for i in range(count):
        h.pose[ALPHA + i] = reference[CHI, ALPHA + i] + h.correction[0, i]
    now, _ = hand_in_world(h.chain, h.pose)
    rotation = rows(matrix_from_euler(state[CHI, ATTITUDE]))
    hand_jacobian(h.chain, h.pose[ALPHA:], times(-1.0, rotation[2]), h.jacobian)
    error = turned(transposed(rotation), minus(wanted, now))
    away = math.sqrt(dot(error, error))
    return error, away if math.isfinite(away) else math.inf


@jit
def _least(h: HandArrays, error: Vector, square: np.ndarray, damping: float) -> Vector:
    """Return y, so that J^T y is the least correction that has the hand where it should be.

    (J J^T + damping^2) y = error + J correction, solved by Cramer's rule. square: J J^T, to whose
    diagonal the damping is added.
    """
    jacobian, count = h.jacobian[X:ROLL], h.correction.shape[1]
    goal = np.array(error)
    for i in range(count):
        for j in range(3):
            goal[j] += jacobian[j, i] * h.correction[0, i]
    for j in range(3):
        square[j, j] += damping * damping
    a, b, c = rows(square)
    g = vector(goal)
    size = dot(a, cross(b, c))
    return (
        dot(g, cross(b, c)) / size,
        dot(a, cross(g, c)) / size,
        dot(a, cross(b, g)) / size,
    )
