"""Torques of the joints, and force and moment on the base, of a motion (Newton and Euler)."""

from __future__ import annotations

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.kinematics import LEVEL, ORIGIN, next_link
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.vectors import (
    Vector,
    cross,
    dot,
    minus,
    plus,
    rows,
    times,
    transposed,
    turned,
    vector,
    write,
)

ANGLE, RATE, ACCELERATION = range(3)  # rows of a motion
PLACE, AXIS, FORCE, MOMENT = range(4)  # of a joint and its link
LINK = 4  # their number


@jit
def inverse_dynamics(
    chain: Chain,
    motion: np.ndarray,
    force: Vector,
    rates: Vector,
    turning: Vector,
    torques: np.ndarray,
) -> tuple[Vector, Vector]:
    """Write the joint torques (n,) [N m] of a motion; return force [N] and moment [N m].

    motion (3, n): angles [rad], rates, accelerations of the joints; of the base, all in its frame
    (FLU): force [m/s^2], the specific force R^T (p_ddot + g e3) at its origin, rates [rad/s] and
    turning [rad/s^2], their derivative. Force and moment are those that the base exerts on the arm,
    the moment about the base's origin. Without friction and damping of the joints.
    """
    found = np.empty((motion.shape[1], LINK, 3))
    return newton_euler(chain, motion, force, rates, turning, torques, found)


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
    """Do what `inverse_dynamics` does, with the memory found (n, LINK, 3) of the links."""
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
    """Do what `inverse_dynamics` does, with the base: return what acts on the whole vehicle."""
    push, moment = inverse_dynamics(chain, motion, force, rates, turning, torques)
    centre, inertia = vector(chain.base_centre), rows(chain.base_inertia)
    own = times(chain.base_mass, plus(force, _carried(rates, turning, centre)))
    twist = plus(turned(inertia, turning), cross(rates, turned(inertia, rates)))
    return plus(push, own), plus(moment, plus(twist, cross(centre, own)))


@jit
def gravity_torque(
    chain: Chain, angles: np.ndarray, force: Vector, torques: np.ndarray
) -> tuple[Vector, Vector]:
    """Write the joint torques (n,) [N m] that hold the arm still; return as `inverse_dynamics`.

    angles (n,) [rad]; force [m/s^2]: (0, 0, g) for a level base at rest.
    """
    motion = np.zeros((3, len(angles)))
    motion[ANGLE] = angles
    return inverse_dynamics(chain, motion, force, ORIGIN, ORIGIN, torques)


@jit
def mass_matrix(chain: Chain, angles: np.ndarray, matrix: np.ndarray) -> None:
    """Write the inertia of the joints (n, n) [kg m^2] for a base that does not move."""
    motion = np.zeros((3, len(angles)))
    motion[ANGLE] = angles
    for i in range(len(angles)):
        motion[ACCELERATION, i] = 1.0
        inverse_dynamics(chain, motion, ORIGIN, ORIGIN, ORIGIN, matrix[i])
        motion[ACCELERATION, i] = 0.0
