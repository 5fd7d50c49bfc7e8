"""The flying vehicle in coordinates that its inertia does not couple.

V = [v, Omega, alpha_dot] of the base's origin becomes xi = T V = [c_dot, Omega, rho], of the centre
of mass c and with rho = alpha_dot + N Omega. Then M = T^T diag(m I, M_r, M_rho) T. About the centre
of mass, M_qq is the inertia of the joints and M_qw that between joints and base:

    M_rho = M_qq,   N = M_rho^-1 M_qw,   M_r = M_ww - M_qw^T N
"""

from typing import NamedTuple

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.hand import heading
from uam_control.arm.kinematics import (
    ACCELERATION,
    ANGLE,
    DOWN,
    ORIGIN,
    hand_jacobian,
    hand_pose,
    vehicle_centre,
    vehicle_dynamics,
)
from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, ROLL
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import matrix_from_euler
from uam_control.maths.vectors import (
    Rows,
    Vector,
    cross,
    minus,
    plus,
    product,
    rows,
    times,
    turned,
    vector,
)

STEP = 1e-4  # [s] of the derivatives along a motion
TASK = 4  # place of the hand from the centre of mass [m, world], and its heading [rad]


class Decoupled(NamedTuple):
    """Inertia of a posture, in the base's frame; see the module."""

    mass: float  # [kg]
    centre: Vector  # [m]
    first: np.ndarray  # (3, n) d centre / d alpha
    turning: np.ndarray  # (3, 3) M_r
    joints: np.ndarray  # (n, n) M_rho
    coupling: np.ndarray  # (n, 3) N


def stiff(chain: Chain) -> Chain:
    """Return the chain with the hinge of a hand that hangs as the hand: below it all hangs down."""
    none = np.zeros(3)
    return chain._replace(swing_axis=none, swing_reach=none, swing_mass=0.0)


@jit
def decoupled(chain: Chain, angles: np.ndarray) -> Decoupled:
    """Return the decoupled inertia of a posture, angles (n,) [rad]; chain: see `stiff`."""
    count = len(angles)
    motion = np.zeros((3, count))
    motion[ANGLE] = angles
    mass, centre = chain.masses.sum() + chain.base_mass, vehicle_centre(chain, angles, DOWN)
    turning, coupling = np.empty((3, 3)), np.empty((count, 3))
    joints, first = np.empty((count, count)), np.empty((3, count))
    for j in range(count):
        motion[ACCELERATION, j] = 1.0
        push, _ = vehicle_dynamics(chain, motion, ORIGIN, ORIGIN, ORIGIN, joints[j])
        motion[ACCELERATION, j] = 0.0
        first[:, j] = np.array(push) / mass
    torques = np.empty(count)
    for k in range(3):
        unit = vector(np.eye(3)[k])
        push, moment = vehicle_dynamics(chain, motion, ORIGIN, ORIGIN, unit, torques)
        turning[:, k] = np.array(minus(moment, cross(centre, push)))
        coupling[:, k] = torques - first.T @ np.array(push)
    joints -= mass * (first.T @ first)
    found = np.linalg.solve(joints, coupling)
    turning -= coupling.T @ found
    return Decoupled(mass, centre, first, turning, joints, found)


@jit
def _along(motion: np.ndarray, time: float) -> np.ndarray:
    """Return the angles (n,) [rad] of motion (3, n), `time` [s] later at its rates."""
    return motion[CHI] + time * motion[CHI_DOT]


@jit
def centre_motion(chain: Chain, chi: np.ndarray) -> tuple[Vector, Vector, Vector]:
    """Return the vehicle's centre [m, world], its velocity and acceleration; chi (3, 6 + n)."""
    turn, rates = rows(matrix_from_euler(chi[CHI, ROLL:ALPHA])), vector(chi[CHI_DOT, ROLL:ALPHA])
    joints = chi[:, ALPHA:].copy()
    centre = vehicle_centre(chain, joints[CHI], DOWN)
    after = vehicle_centre(chain, _along(joints, STEP), DOWN)
    before = vehicle_centre(chain, _along(joints, -STEP), DOWN)
    drift = times(0.5 / STEP, minus(after, before))
    velocity = turned(turn, plus(cross(rates, centre), drift))
    own = _own_acceleration(chain, chi)
    return (
        plus(vector(chi[CHI]), turned(turn, centre)),
        plus(vector(chi[CHI_DOT]), velocity),
        plus(vector(chi[CHI_DDOT]), turned(turn, own)),
    )


@jit
def _own_acceleration(chain: Chain, chi: np.ndarray) -> Vector:
    """Return the acceleration [m/s^2, base's frame] of the centre of mass beyond the origin's."""
    rates, change = vector(chi[CHI_DOT, ROLL:ALPHA]), vector(chi[CHI_DDOT, ROLL:ALPHA])
    joints, torques = chi[:, ALPHA:].copy(), np.empty(chi.shape[1] - ALPHA)
    push, _ = vehicle_dynamics(chain, joints, ORIGIN, rates, change, torques)
    return times(1.0 / (chain.masses.sum() + chain.base_mass), push)


@jit
def task_jacobian(
    chain: Chain, d: Decoupled, angles: np.ndarray, turn: Rows
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of the task's rates by Omega (4, 3) and by rho (4, n).

    angles (n,) [rad]; turn: base → world.
    """
    count, jacobian = len(angles), np.empty((6, len(angles)))
    hand_jacobian(chain, angles, DOWN, jacobian)
    reach = minus(hand_pose(chain, angles, DOWN)[0], d.centre)
    by_turning, by_joints = np.empty((TASK, 3)), np.empty((TASK, count))
    for k in range(3):
        unit = vector(np.eye(3)[k])
        _put_rates(turn, cross(unit, reach), unit, by_turning[:, k])
    for j in range(count):
        linear = vector(jacobian[:3, j] - d.first[:, j])
        _put_rates(turn, linear, vector(jacobian[3:, j]), by_joints[:, j])
    return by_turning - by_joints @ d.coupling, by_joints


@jit
def _put_rates(turn: Rows, linear: Vector, spin: Vector, column: np.ndarray) -> None:
    column[0], column[1], column[2] = turned(turn, linear)
    column[3] = turned(turn, spin)[2]


@jit
def write_task(chain: Chain, chi: np.ndarray, task: np.ndarray) -> None:
    """Write the task, its rate and acceleration to task (3, 4); chi (3, 6 + n).

    The rate of the heading is the tool's angular velocity about the vertical.
    """
    turn, rates = rows(matrix_from_euler(chi[CHI, ROLL:ALPHA])), vector(chi[CHI_DOT, ROLL:ALPHA])
    change, joints = vector(chi[CHI_DDOT, ROLL:ALPHA]), chi[:, ALPHA:].copy()
    count = joints.shape[1]
    now, after, before = np.empty((6, count)), np.empty((6, count)), np.empty((6, count))
    hand_jacobian(chain, joints[CHI], DOWN, now)
    hand_jacobian(chain, _along(joints, STEP), DOWN, after)
    hand_jacobian(chain, _along(joints, -STEP), DOWN, before)
    moves = now @ joints[CHI_DOT]
    bends = now @ joints[CHI_DDOT] + (after - before) @ joints[CHI_DOT] / (2.0 * STEP)
    place, tool = hand_pose(chain, joints[CHI], DOWN)
    # of the hand from the base's origin, in the base's frame
    drift, spin = vector(moves[:3]), vector(moves[3:])
    velocity = plus(cross(rates, place), drift)
    acceleration = plus(
        plus(cross(change, place), vector(bends[:3])), cross(rates, plus(velocity, drift))
    )
    twist = plus(plus(change, vector(bends[3:])), cross(rates, spin))
    centre, speed, _ = centre_motion(chain, chi)
    hand = plus(vector(chi[CHI]), turned(turn, place))
    task[CHI, 0], task[CHI, 1], task[CHI, 2] = minus(hand, centre)
    task[CHI, 3] = heading(product(turn, tool))
    _put_rates(turn, velocity, plus(rates, spin), task[CHI_DOT])
    _put_rates(turn, minus(acceleration, _own_acceleration(chain, chi)), twist, task[CHI_DDOT])
    own = minus(speed, vector(chi[CHI_DOT]))
    for k in range(3):
        task[CHI_DOT, k] -= own[k]
