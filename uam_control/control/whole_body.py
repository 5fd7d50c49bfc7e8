"""Whole-body L1: force, torque and joint torques from one computation (docs/law.md).

It uses the three controllers: their parameters, adapted gains, limits and output, so that recorder,
supervisor and bridge see three laws. Coordinates and inertia: `arm.floating`; d, d_int:
`laws.whole_body`.
"""

import math
from collections.abc import Callable
from operator import is_
from typing import NamedTuple

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.floating import (
    TASK,
    Decoupled,
    centre_motion,
    decoupled,
    stiff,
    task_jacobian,
    write_task,
)
from uam_control.arm.kinematics import ORIGIN, vehicle_dynamics
from uam_control.control.arm_load import friction
from uam_control.control.around_law import (
    ArmArrays,
    AttitudeArrays,
    PositionArrays,
    begin_law,
    command_goals,
    given,
)
from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.control.output_limits import complete_and_limit, limit_torque
from uam_control.control.thrust_direction import write_thrust_attitude
from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, PITCH, ROLL, YAW, Z
from uam_control.laws.errors import E_DOT, FEEDFORWARD, E
from uam_control.laws.geometric import feed_back
from uam_control.laws.law import LawArrays
from uam_control.laws.whole_body import observe
from uam_control.maths.compiled import jit
from uam_control.maths.kept_tuple import bound
from uam_control.maths.rotations import body_rates, matrix_from_euler
from uam_control.maths.vectors import Vector, cross, dot, minus, plus, rows, times, turned, vector

UP = (0.0, 0.0, 1.0)


class WholeBodyArrays(NamedTuple):
    """Those of the three controllers, of their laws, and the vehicle, see `stiff`."""

    position: PositionArrays
    attitude: AttitudeArrays
    arm: ArmArrays
    laws: tuple[LawArrays, LawArrays, LawArrays]
    chain: Chain


class WholeBody:
    """The law over its three controllers; `arrays`: see `WholeBodyArrays`."""

    def __init__(
        self, position: PositionController, attitude: AttitudeController, arm: ArmController
    ) -> None:
        self._controllers = position, attitude, arm
        self._step, self._of = None, ()

    @property
    def arrays(self) -> WholeBodyArrays:
        """Those of the present parameters."""
        of = [one.arrays for one in self._controllers]
        laws = tuple(one.law.arrays for one in self._controllers)
        return WholeBodyArrays(*of, laws, stiff(of[-1].load.chain))

    def _prepared(self) -> Callable:
        """Return the step, made anew where a controller's arrays are others."""
        of = tuple(one.arrays for one in self._controllers)
        if len(of) != len(self._of) or not all(map(is_, of, self._of)):
            rows = np.zeros((3, ALPHA))
            self._of, self._step = of, bound(whole_body_step, self.arrays, rows, rows, 0.0)
        return self._step

    def update(self, state: np.ndarray, reference: np.ndarray, dt: float) -> None:
        """Compute a tick in flight; state, reference: (3, 6 + n), see `coordinates`; dt [s].

        The results are the controllers' tau, and the desired attitude that of the position's.
        """
        for one in self._controllers:
            one.enter(state, reference)
        self._prepared()(state, reference, dt)


@jit
def whole_body_step(
    a: WholeBodyArrays, state: np.ndarray, reference: np.ndarray, dt: float
) -> None:
    """Write tau of the three controllers and the desired attitude; see `WholeBody.update`."""
    chain, angles = a.chain, state[CHI, ALPHA:].copy()
    d = decoupled(chain, angles)
    turn = matrix_from_euler(state[CHI, ROLL:ALPHA])
    centre, velocity, _ = centre_motion(chain, state)
    _observe(a, d, velocity, state, dt)
    wanted = _planned(reference)
    plan = centre_motion(chain, wanted)
    thrust = _force(a, (centre, velocity), plan, turn, state, wanted, reference[:, YAW].copy(), dt)
    turns = _turning(a, d, state, wanted, dt)
    net = _arm(a, d, state, wanted, turns)
    _torques(a, d, state, wanted, thrust, turns, net)
    up = vector(turn[:, Z])
    pulled = plus(times(thrust / d.mass, up), times(-a.arm.load.gravity, UP))
    _predict(a, d, plus(velocity, times(dt, pulled)), state, turns, net, dt)
    command_goals(a.arm, state, reference, dt)


@jit
def _planned(reference: np.ndarray) -> np.ndarray:
    """Return the reference with body rates in place of those of its Euler angles."""
    wanted = reference.copy()
    angles, change = reference[CHI, ROLL:ALPHA], reference[CHI_DOT, ROLL:ALPHA]
    wanted[CHI_DOT, ROLL], wanted[CHI_DOT, PITCH], wanted[CHI_DOT, YAW] = body_rates(
        angles[0], angles[1], change[0], change[1], change[2]
    )
    return wanted


@jit
def _observe(
    a: WholeBodyArrays, d: Decoupled, velocity: Vector, state: np.ndarray, dt: float
) -> None:
    """Find the disturbance from what moved beyond the prediction; see `laws.whole_body`."""
    p, q, r = a.laws
    moved, spun = np.empty(3), np.empty(3)
    for i in range(3):
        moved[i] = d.mass * (velocity[i] - p.adaptation[6 + i])
        spun[i] = state[CHI_DOT, ROLL + i] - q.adaptation[6 + i]
    count = len(r.tau)
    bent = state[CHI_DOT, ALPHA:] - r.adaptation[2 * count : 3 * count] + d.coupling @ spun
    position, attitude, arm = a.position.all, a.attitude.all, a.arm.all
    observe(p.record[0], moved, position.numbers[0].frozen != 0, dt, p.adaptation)
    observe(q.record[0], d.turning @ spun, attitude.numbers[0].frozen != 0, dt, q.adaptation)
    observe(r.record[0], d.joints @ bent, arm.numbers[0].frozen != 0, dt, r.adaptation)


@jit
def _predict(
    a: WholeBodyArrays,
    d: Decoupled,
    velocity: Vector,
    state: np.ndarray,
    turns: np.ndarray,
    net: np.ndarray,
    dt: float,
) -> None:
    """Predict the rates of the next tick: velocity of the centre; turns, net: see `_torques`."""
    p, q, r = a.laws
    count = len(net)
    spin = np.linalg.solve(d.turning, turns)
    bend = np.linalg.solve(d.joints, net) - d.coupling @ spin
    for i in range(3):
        p.adaptation[6 + i] = velocity[i]
        q.adaptation[6 + i] = state[CHI_DOT, ROLL + i] + dt * spin[i]
    for i in range(count):
        r.adaptation[2 * count + i] = state[CHI_DOT, ALPHA + i] + dt * bend[i]
    p.adaptation[9] = q.adaptation[9] = r.adaptation[3 * count] = 1.0


@jit
def _force(
    a: WholeBodyArrays,
    now: tuple[Vector, Vector],
    plan: tuple[Vector, Vector, Vector],
    turn: np.ndarray,
    state: np.ndarray,
    wanted: np.ndarray,
    heading: np.ndarray,
    dt: float,
) -> float:
    """Write tau_p and the desired attitude of it; return the thrust [N].

    f = m (c_d_ddot + g e3) - k_x e - k_v e_dot - d, of the centre of mass: now: place and velocity;
    plan: those of the reference, and its acceleration; heading (3,): yaw [rad] and derivatives. The
    derivatives of f, for the attitude's, contain the acceleration that thrust and d make, not a
    measured one.
    """
    p, of = a.position, a.position.all
    begin_law(of, state, wanted, p.attitude, True)
    law, m = a.laws[0], of.numbers[0]
    for i in range(3):
        of.own[E][i] = now[0][i] - plan[0][i]
        of.own[E_DOT][i] = now[1][i] - plan[1][i]
        of.own[FEEDFORWARD][i] = plan[2][i]
    feed_back(law.record[0], given(of, dt), law.tau)
    for i in range(3):
        law.tau[i] -= law.adaptation[i]
    m.saturated = complete_and_limit(
        wanted, of.own[E], p.completion, m.saturated != 0, dt, p.carried, law.tau, of.tau
    )
    up, force = vector(turn[:, Z]), vector(of.tau)
    thrust = dot(force, up)
    gains, mass, g = law.record[0], p.completion.inertia[Z], a.arm.load.gravity
    found = vector(law.adaptation[:3])
    velocity, own = vector(of.own[E_DOT]), vector(of.own[FEEDFORWARD])
    jerk, snap = _planned_jerk(wanted, plus(own, times(g, UP)))
    off = minus(times(1.0 / mass, plus(times(thrust, up), found)), plus(times(g, UP), own))
    push = minus(times(mass, jerk), _fed(gains, velocity, off))
    swings = turned(rows(turn), cross(vector(state[CHI_DOT, ROLL:ALPHA]), UP))
    growth = dot(push, up) + dot(force, swings)
    jump = minus(times(1.0 / mass, plus(times(growth, up), times(thrust, swings))), jerk)
    rush = minus(times(mass, snap), _fed(gains, off, jump))
    write_thrust_attitude(force, push, rush, heading, p.attitude)
    return thrust


@jit
def _fed(gains: np.record, value: Vector, rate: Vector) -> Vector:
    """Return k_x value + k_v rate."""
    first, second, inertia = gains.lambda_1, gains.lambda_2, gains.inertia
    return (
        inertia[0] * (first[0] * value[0] + second[0] * rate[0]),
        inertia[1] * (first[1] * value[1] + second[1] * rate[1]),
        inertia[2] * (first[2] * value[2] + second[2] * rate[2]),
    )


@jit
def _planned_jerk(wanted: np.ndarray, force: Vector) -> tuple[Vector, Vector]:
    """Return jerk [m/s^3] and snap of the reference, across its thrust: what turns its attitude.

    force [m/s^2]: its specific force. The change of its size is left out.
    """
    turn, size = rows(matrix_from_euler(wanted[CHI, ROLL:ALPHA])), math.sqrt(dot(force, force))
    rates, change = vector(wanted[CHI_DOT, ROLL:ALPHA]), vector(wanted[CHI_DDOT, ROLL:ALPHA])
    swings = cross(rates, UP)
    bends = plus(cross(change, UP), cross(rates, swings))
    return times(size, turned(turn, swings)), times(size, turned(turn, bends))


@jit
def _turning(
    a: WholeBodyArrays, d: Decoupled, state: np.ndarray, wanted: np.ndarray, dt: float
) -> np.ndarray:
    """Return M_r (Omega_c_dot - lambda_1 e_R - lambda_2 e_Omega) - d_r (3,) [N m]."""
    of, law = a.attitude.all, a.laws[1]
    begin_law(of, state, wanted, a.position.attitude, True)
    feed_back(law.record[0], given(of, dt), law.tau)
    return d.turning @ (law.tau / a.attitude.inertia) - law.adaptation[:3]


@jit
def _arm(
    a: WholeBodyArrays, d: Decoupled, state: np.ndarray, wanted: np.ndarray, turns: np.ndarray
) -> np.ndarray:
    """Return the generalised force (n,) [N m] along rho that moves the hand as it should.

    The hand is judged from the centre of mass: y = (place - c, heading). J# is the dynamically
    consistent inverse, L the inertia of the task, J_3 = L J_rho M_rho^-1:

        J_3+ [L (y_d_ddot - lambda_1 e_y - lambda_2 e_y_dot - y_ddot_0) - J_3 d_int]

    y_ddot_0: what y does without that force; d_int of the base's turning is in it. J_3+ is damped.
    More joints than the task needs hold their reference in what is left, J_3+ J_3 = 0.
    """
    of, law = a.arm.all, a.laws[2]
    begin_law(of, state, wanted, a.position.attitude, True)
    p, count, motion = law.record[0], len(of.tau), state.copy()
    spin = np.linalg.solve(d.turning, turns + a.laws[1].adaptation[3:6])
    motion[CHI_DDOT, ROLL:ALPHA] = spin
    motion[CHI_DDOT, ALPHA:] = -(d.coupling @ spin)
    now, plan, lack = np.empty((3, TASK)), np.empty((3, TASK)), np.empty(TASK)
    write_task(a.chain, motion, now)
    write_task(a.chain, wanted, plan)
    for i in range(TASK):
        error = now[CHI, i] - plan[CHI, i]
        if i == TASK - 1:
            error = math.atan2(math.sin(error), math.cos(error))
        fed = p.task_lambda_1[i] * error + p.task_lambda_2[i] * (now[CHI_DOT, i] - plan[CHI_DOT, i])
        lack[i] = plan[CHI_DDOT, i] - fed - now[CHI_DDOT, i]
    turn = rows(matrix_from_euler(state[CHI, ROLL:ALPHA]))
    by_turning, by_joints = task_jacobian(a.chain, d, state[CHI, ALPHA:].copy(), turn)
    share = np.linalg.solve(d.joints, by_joints.T)
    light = by_turning @ np.linalg.solve(d.turning, by_turning.T) + by_joints @ share
    for i in range(TASK - 1):
        light[i, i] += 1.0 / d.mass
    inertia = np.linalg.inv(light)
    pull = inertia @ share.T
    damped = pull @ pull.T + p.task_damping**2 * np.eye(TASK)
    internal = law.adaptation[count : 2 * count].copy()
    net = pull.T @ np.linalg.solve(damped, inertia @ lack - pull @ internal)
    if count > TASK:
        feed_back(p, given(of, 0.0), law.tau)
        posture = d.joints @ (law.tau / a.arm.inertia)
        net += posture - pull.T @ np.linalg.solve(damped, pull @ posture)
    return net


@jit
def _torques(
    a: WholeBodyArrays,
    d: Decoupled,
    state: np.ndarray,
    wanted: np.ndarray,
    thrust: float,
    turns: np.ndarray,
    net: np.ndarray,
) -> None:
    """Write tau_q and tau_alpha of a motion, T^T [u1 R e3; u2; u3], within their limits.

    turns (3,), net (n,) [N m]: M_r Omega_dot and M_rho rho_dot of the law; they become what the
    limits leave of them. A joint's torque that is cut is missing at the base, too: N^T of it.
    """
    q, r, count = a.attitude, a.arm, len(net)
    motion, spin = np.empty((3, count)), np.linalg.solve(d.turning, turns)
    motion[:CHI_DDOT] = state[:CHI_DDOT, ALPHA:]
    motion[CHI_DDOT] = np.linalg.solve(d.joints, net) - d.coupling @ spin
    rates, change = vector(state[CHI_DOT, ROLL:ALPHA]), vector(spin)
    torques = np.empty(count)
    push, moment = vehicle_dynamics(a.chain, motion, ORIGIN, rates, change, torques)
    force = minus(times(thrust, UP), push)  # that the motion of the centre of mass adds
    found = np.array(plus(moment, cross(d.centre, force)))
    torques += d.first.T @ np.array(force)
    given = torques.copy()
    for j in range(count if r.load.on else 0):
        given[j] += friction(r.load, j, wanted[CHI_DOT, ALPHA + j], torques[j])
    r.all.numbers[0].saturated = limit_torque(given, r.torque_max, r.all.tau)
    cut = r.all.tau - given
    net += cut
    found += d.coupling.T @ cut
    q.all.numbers[0].saturated = limit_torque(found, q.torque_max, q.all.tau)
    turns += q.all.tau - found
