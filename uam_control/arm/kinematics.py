"""Where arm and end effector are, in the base frame (FLU), and torques and forces of a motion."""

import math

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.vectors import (
    Rows,
    Vector,
    about,
    cross,
    dot,
    minus,
    plus,
    product,
    rows,
    times,
    transposed,
    turned,
    vector,
    write,
)

DOWN = (0.0, 0.0, -1.0)  # of a level base
LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ORIGIN = (0.0, 0.0, 0.0)
UPRIGHT = 1e-9  # a hinge along its load or along the vertical does not swing
ANGLE, RATE, ACCELERATION = range(3)  # rows of a motion
PLACE, AXIS, FORCE, MOMENT = range(4)  # of a joint and its link
LINK = 4  # their number


@borrowing
def next_link(chain: Chain, i: int, angle: float, place: Vector, turn: Rows) -> tuple[Vector, Rows]:
    """Return joint [m] and rotation of link i at an angle [rad], from those of the link before."""
    place = plus(place, turned(turn, vector(chain.offsets[i])))
    return place, product(turn, about(vector(chain.axes[i]), angle))


@borrowing
def last_link(chain: Chain, angles: np.ndarray) -> tuple[Vector, Rows]:
    """Return the last joint [m] and the rotation of its link; angles (n,) [rad]."""
    place, turn = ORIGIN, LEVEL
    for i in range(len(angles)):
        place, turn = next_link(chain, i, angles[i], place, turn)
    return place, turn


@borrowing
def hanging(chain: Chain, turn: Rows, down: Vector) -> Rows:
    """Return the rotation of what carries the end effector.

    turn: of the last link; down: unit vector in the base frame along which a load hangs. It is
    `turn`, except for an end effector on a passive hinge: its load is as far down as it can be.
    """
    axis, load = vector(chain.swing_axis), vector(chain.swing_centre)
    below = turned(transposed(turn), down)
    load = minus(load, times(dot(load, axis), axis))
    below = minus(below, times(dot(below, axis), axis))
    if dot(axis, axis) == 0.0 or dot(load, load) * dot(below, below) < UPRIGHT**2:
        return turn
    return product(turn, about(axis, math.atan2(dot(axis, cross(load, below)), dot(load, below))))


@borrowing
def hand_pose(chain: Chain, angles: np.ndarray, down: Vector) -> tuple[Vector, Rows]:
    """Return position [m] and rotation (end effector → base) of the end effector.

    angles (n,) [rad]; down: see `hanging`; `DOWN` for a level base.
    """
    place, turn = last_link(chain, angles)
    place = plus(place, turned(turn, vector(chain.hand_place)))
    turn = hanging(chain, turn, down)
    place = plus(place, turned(turn, vector(chain.swing_reach)))
    return place, product(turn, rows(chain.hand_turn))


@borrowing
def hand_jacobian(chain: Chain, angles: np.ndarray, down: Vector, jacobian: np.ndarray) -> None:
    """Write velocity [m/s] and angular velocity [rad/s] of the hand per joint rate, (6, n).

    In the base frame, of the position and rotation of `hand_pose`; a hinge keeps its load down.
    """
    place, last = last_link(chain, angles)
    hinge = plus(place, turned(last, vector(chain.hand_place)))
    turn = hanging(chain, last, down)
    reach = turned(turn, vector(chain.swing_reach))
    place, turn_i = ORIGIN, LEVEL
    for i in range(len(angles)):
        place, turn_i = next_link(chain, i, angles[i], place, turn_i)
        axis = turned(turn_i, vector(chain.axes[i]))
        spin = plus(axis, _swing_rate(chain, turn, down, axis))
        linear = plus(cross(axis, minus(hinge, place)), cross(spin, reach))
        for k in range(3):
            jacobian[k, i], jacobian[3 + k, i] = linear[k], spin[k]


@borrowing
def _swing_rate(chain: Chain, turn: Rows, down: Vector, spin: Vector) -> Vector:
    """Return the angular velocity with which a hinge keeps its load down in a link that turns.

    turn: of `hanging`; spin: angular velocity of the link. The load stays in the plane of axis and
    vertical.
    """
    axis, load = turned(turn, vector(chain.swing_axis)), turned(turn, vector(chain.swing_centre))
    across = cross(axis, down)
    holds = dot(cross(axis, load), across)
    if abs(holds) < UPRIGHT:
        return ORIGIN
    leaves = dot(cross(spin, load), across) + dot(load, cross(cross(spin, axis), down))
    return times(-leaves / holds, axis)


@borrowing
def arm_moment(chain: Chain, angles: np.ndarray, down: Vector) -> tuple[float, Vector]:
    """Return mass [kg] and first moment [kg m] of the links about the base's origin."""
    mass, moment = 0.0, ORIGIN
    place, turn = ORIGIN, LEVEL
    for i in range(len(angles)):
        place, turn = next_link(chain, i, angles[i], place, turn)
        centre = plus(place, turned(turn, vector(chain.centres[i])))
        mass += chain.masses[i]
        moment = plus(moment, times(chain.masses[i], centre))
    hangs = turned(hanging(chain, turn, down), vector(chain.swing_centre))
    return mass, plus(moment, times(chain.swing_mass, hangs))


@borrowing
def vehicle_centre(chain: Chain, angles: np.ndarray, down: Vector) -> Vector:
    """Return the centre of mass [m] of base and links."""
    mass, moment = arm_moment(chain, angles, down)
    moment = plus(moment, times(chain.base_mass, vector(chain.base_centre)))
    return times(1.0 / (mass + chain.base_mass), moment)


@borrowing
def newton_euler(
    chain: Chain,
    motion: np.ndarray,
    force: Vector,
    rates: Vector,
    turning: Vector,
    torques: np.ndarray,
    found: np.ndarray,
) -> tuple[Vector, Vector]:
    """Write the joint torques (n,) [N m] of a motion; return force [N] and moment [N m].

    motion (3, n): angles [rad], rates, accelerations of the joints; of the base, all in its frame
    (FLU): force [m/s^2], the specific force R^T (p_ddot + g e3) at its origin, rates [rad/s] and
    turning [rad/s^2], their derivative; found (n, LINK, 3): memory. Force and moment are those that
    the base exerts on the arm, the moment about the base's origin. Without friction and damping of
    the joints.
    """
    count = motion.shape[1]
    place, turn = ORIGIN, LEVEL
    for i in range(count):
        joint, after = next_link(chain, i, motion[ANGLE, i], place, turn)
        force = plus(force, _carried(rates, turning, minus(joint, place)))
        place, turn = joint, after
        axis = turned(turn, vector(chain.axes[i]))
        spin = times(motion[RATE, i], axis)
        turning = plus(turning, plus(times(motion[ACCELERATION, i], axis), cross(rates, spin)))
        rates = plus(rates, spin)
        centre = turned(turn, vector(chain.centres[i]))
        push = times(chain.masses[i], plus(force, _carried(rates, turning, centre)))
        back, inertia = transposed(turn), rows(chain.inertias[i])
        own = turned(back, rates)
        twist = plus(turned(inertia, turned(back, turning)), cross(own, turned(inertia, own)))
        write(place, found[i, PLACE])
        write(axis, found[i, AXIS])
        write(push, found[i, FORCE])
        write(plus(turned(turn, twist), cross(plus(place, centre), push)), found[i, MOMENT])
    total, moment = ORIGIN, ORIGIN
    for i in range(count - 1, -1, -1):
        total = plus(total, vector(found[i, FORCE]))
        moment = plus(moment, vector(found[i, MOMENT]))
        about_joint = minus(moment, cross(vector(found[i, PLACE]), total))
        own_inertia = chain.armature[i] * motion[ACCELERATION, i]
        torques[i] = dot(vector(found[i, AXIS]), about_joint) + own_inertia
    return total, moment


@borrowing
def _carried(rates: Vector, turning: Vector, point: Vector) -> Vector:
    """Return the acceleration [m/s^2] of a point [m] of a body that turns, beyond its origin's."""
    return plus(cross(turning, point), cross(rates, cross(rates, point)))


@jit
def vehicle_dynamics(
    chain: Chain,
    motion: np.ndarray,
    force: Vector,
    rates: Vector,
    turning: Vector,
    torques: np.ndarray,
) -> tuple[Vector, Vector]:
    """Do what `newton_euler` does, with the base: return what acts on the whole vehicle."""
    found = np.empty((motion.shape[1], LINK, 3))
    push, moment = newton_euler(chain, motion, force, rates, turning, torques, found)
    centre, inertia = vector(chain.base_centre), rows(chain.base_inertia)
    own = times(chain.base_mass, plus(force, _carried(rates, turning, centre)))
    twist = plus(turned(inertia, turning), cross(rates, turned(inertia, rates)))
    return plus(push, own), plus(moment, plus(twist, cross(centre, own)))


@jit
def gravity_torque(
    chain: Chain, angles: np.ndarray, force: Vector, torques: np.ndarray
) -> tuple[Vector, Vector]:
    """Write the joint torques (n,) [N m] that hold the arm still; return as `newton_euler`.

    angles (n,) [rad]; force [m/s^2]: (0, 0, g) for a level base at rest.
    """
    motion = np.zeros((3, len(angles)))
    motion[ANGLE] = angles
    found = np.empty((len(angles), LINK, 3))
    return newton_euler(chain, motion, force, ORIGIN, ORIGIN, torques, found)


@jit
def mass_matrix(chain: Chain, angles: np.ndarray, matrix: np.ndarray) -> None:
    """Write the inertia of the joints (n, n) [kg m^2] for a base that does not move."""
    motion = np.zeros((3, len(angles)))
    motion[ANGLE], found = angles, np.empty((len(angles), LINK, 3))
    for i in range(len(angles)):
        motion[ACCELERATION, i] = 1.0
        newton_euler(chain, motion, ORIGIN, ORIGIN, ORIGIN, matrix[i], found)
        motion[ACCELERATION, i] = 0.0
