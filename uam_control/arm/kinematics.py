"""Where arm and end effector are, in the base frame (FLU), from the joint angles."""

from __future__ import annotations

import math

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.maths.compiled import borrowing
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
)

DOWN = (0.0, 0.0, -1.0)  # of a level base
LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ORIGIN = (0.0, 0.0, 0.0)
UPRIGHT = 1e-9  # a hinge along its load or along the vertical does not swing


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
