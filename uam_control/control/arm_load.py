"""Feedforward of the arm's known load: joint torques, and the moment on the base.

The motion is that of the reference: specific force R_d^T (p_d_ddot + g e3) and body rates of the
base, joint angles with their derivatives. The printed laws contain no weight of the arm
(docs/law.md); unknown loads stay with feedback and adaptation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.arm.chain import Chain, ChainParameters
from uam_control.arm.kinematics import DOWN, LINK, ORIGIN, newton_euler, vehicle_centre
from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, PITCH, ROLL, YAW, X, Y, Z
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import put
from uam_control.maths.rotations import rows_from_euler
from uam_control.maths.vectors import Vector, cross, minus, plus, times, transposed, turned, vector
from uam_control.settings import parameter_set
from uam_control.settings.parameter_set import ANY_LENGTH, ParameterError, number, switch
from uam_control.vehicle import GRAVITY

FRICTION_SPEED = 0.05  # [rad/s] of the reference at which tanh(1) of the dry friction is added


@dataclass(frozen=True)
class ArmLoadParameters(ChainParameters):
    """The arm's numbers, and whether its known load is fed forward."""

    arm_feedforward: bool = switch(
        False, "the known load of the arm is fed forward; false: as printed"
    )
    arm_gravity: float = number(GRAVITY, "acceleration of gravity", "m/s^2", 0.0, 30.0)
    joint_load_friction: tuple = parameter_set.vector(
        (), "friction of each joint per torque; none: 0", "1", 0.0, 0.9, ANY_LENGTH, True
    )

    def check_together(self) -> None:
        super().check_together()
        if self.arm_feedforward and not self.link_masses:
            raise ParameterError("arm_feedforward: needs link_masses, the mass of each link")
        given, joints = len(self.joint_load_friction), len(self.link_masses)
        if given not in (0, joints):
            raise ParameterError(f"joint_load_friction: {given} numbers, {joints} expected")

    def load(self) -> ArmLoad:
        """Return what `arm_load` uses."""
        chain, torques = self.chain(), np.zeros(len(self.link_masses))
        share = np.array(self.joint_load_friction or torques, dtype=float)
        motion, links = np.zeros((3, len(torques))), np.zeros((len(torques), LINK, 3))
        gravity, on = float(self.arm_gravity), bool(self.arm_feedforward)
        return ArmLoad(chain, share, gravity, on, torques, motion, links)


class ArmLoad(NamedTuple):
    """What `arm_load` uses."""

    chain: Chain
    share: np.ndarray  # (n,) friction per torque
    gravity: float  # [m/s^2]
    on: bool  # whether the load is fed forward
    torques: np.ndarray  # (n,) [N m] of the joints
    motion: np.ndarray  # memory of `newton_euler`
    links: np.ndarray  # the same


@borrowing
def friction(load: ArmLoad, j: int, speed: float, torque: float) -> float:
    """Return the friction [N m] of joint j at a speed [rad/s], while it carries a torque [N m]."""
    dry = load.chain.friction[j] + load.share[j] * abs(torque)
    return load.chain.damping[j] * speed + dry * math.tanh(speed / FRICTION_SPEED)


@borrowing
def arm_load(load: ArmLoad, reference: np.ndarray, angles: np.ndarray, turning: bool) -> Vector:
    """Write the torques of the reference; return the moment on the base (3,) [N m, FLU].

    reference: (3, 6 + n), see `coordinates`; angles (n,) [rad] of the joints, in place of its own;
    turning: also for its angular acceleration. The moment is what the rotors must add because of
    the arm, and of a base whose centre of mass is beside its origin; about the origin, where thrust
    acts. Thrust has the direction of the specific force.
    """
    chain, count = load.chain, len(load.torques)
    chi, acceleration = reference[CHI], reference[CHI_DDOT]
    upward = acceleration[Z] + load.gravity
    to_base = transposed(rows_from_euler(chi[ROLL], chi[PITCH], chi[YAW]))
    force = turned(to_base, (acceleration[X], acceleration[Y], upward))
    rates = vector(reference[CHI_DOT, ROLL:ALPHA])
    change = vector(acceleration[ROLL:ALPHA]) if turning else ORIGIN
    put(angles, load.motion[CHI])
    for row in range(CHI_DOT, CHI_DDOT + 1):
        put(reference[row, ALPHA:], load.motion[row])
    push, moment = newton_euler(chain, load.motion, force, rates, change, load.torques, load.links)
    for j in range(count):
        load.torques[j] += friction(load, j, reference[CHI_DOT, ALPHA + j], load.torques[j])
    moment = plus(moment, cross(vector(chain.base_centre), times(chain.base_mass, force)))
    # nothing pushes aside what the arm's motion pushes: the whole vehicle gives way
    aside = minus(push, times(chain.masses.sum(), force))
    return minus(moment, cross(vehicle_centre(chain, angles, DOWN), aside))
