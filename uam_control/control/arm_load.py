"""Feedforward of the arm's known load: joint torques, and moment on the base.

The links of a planar arm are point masses that hang from joints about the body's -y axis. The
motion is that of the reference: specific force of the base, R_d^T (p_d_ddot + g e3), and joint
angles with their derivatives. Rotation rates of the base are left out. The printed laws contain no
weight of the arm (docs/law.md); unknown loads stay with feedback and adaptation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, ROLL, X, Z
from uam_control.laws.law_parameters import structured
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import matrix_from_euler, rotate_back
from uam_control.settings.parameter_set import (
    ANY_LENGTH,
    ParameterError,
    ParameterSet,
    number,
    switch,
    vector,
)
from uam_control.vehicle import GRAVITY

FRICTION_SPEED = 0.05  # [rad/s] of the reference at which tanh(1) of the dry friction is added


@dataclass(frozen=True)
class ArmLoadParameters(ParameterSet):
    """Masses and lengths of the arm, base to tip, and whether its known load is fed forward."""

    arm_feedforward: bool = switch(
        False, "the known load of the arm is fed forward; false: as printed"
    )
    link_masses: tuple = vector(
        (), "mass of each link, the magnet with the last one", "kg", 0.0, 20.0, ANY_LENGTH, True
    )
    link_centres: tuple = vector(
        (), "joint to the centre of mass of its link", "m", 0.0, 2.0, ANY_LENGTH, True
    )
    link_lengths: tuple = vector(
        (), "joint to the next joint, or to the payload", "m", 0.0, 2.0, ANY_LENGTH, True
    )
    arm_gravity: float = number(GRAVITY, "acceleration of gravity", "m/s^2", 0.0, 30.0)
    joint_armature: float = number(0.0, "reflected inertia of a joint's motor", "kg m^2", 0.0, 10.0)
    joint_damping: float = number(0.0, "viscous friction of a joint", "N m s/rad", 0.0, 10.0)
    joint_friction: float = number(0.0, "dry friction of a joint", "N m", 0.0, 10.0)

    def check_together(self) -> None:
        """See `ParameterSet.check_together`."""
        super().check_together()
        lengths = {len(self.link_masses), len(self.link_centres), len(self.link_lengths)}
        if len(lengths) > 1:
            raise ParameterError(
                "link_masses, link_centres, link_lengths: lists of one length expected"
            )
        if self.arm_feedforward and not self.link_masses:
            raise ParameterError("arm_feedforward: needs link_masses, the mass of each link")

    def load_record(self) -> np.ndarray:
        """Return the structured array (1,) that `arm_load` reads; without links one of zeros."""
        names = ("link_masses", "link_centres", "link_lengths", "arm_gravity")
        names += ("joint_armature", "joint_damping", "joint_friction")
        values = {name: getattr(self, name) for name in names}
        return structured({name: (0.0,) if one == () else one for name, one in values.items()})


@jit
def arm_load(record: np.ndarray, reference: np.ndarray, torques: np.ndarray) -> float:
    """Write the joint torques (n,) [N m] of the reference; return the moment about y [N m, FLU].

    record: of `ArmLoadParameters.load_record`; reference: (3, 6 + n), see `coordinates`. The moment
    is what the rotors must add because of the arm, about the first joint.
    """
    p, n = record[0], len(torques)
    acceleration = reference[CHI_DDOT, X:ROLL].copy()
    acceleration[Z] += p.arm_gravity
    force = rotate_back(matrix_from_euler(reference[CHI, ROLL:ALPHA]), acceleration)
    # a link's direction (sin, -cos) in the body's x-z plane, by the sum of the joint angles
    sines, cosines = np.empty(n), np.empty(n)
    bends = np.empty((n, 2))  # d^2/dt^2 of the direction
    angle = rate = bend = 0.0
    for i in range(n):
        angle += reference[CHI, ALPHA + i]
        rate += reference[CHI_DOT, ALPHA + i]
        bend += reference[CHI_DDOT, ALPHA + i]
        sines[i], cosines[i] = math.sin(angle), math.cos(angle)
        bends[i, 0] = cosines[i] * bend - sines[i] * rate * rate
        bends[i, 1] = sines[i] * bend + cosines[i] * rate * rate
    for j in range(n):
        speed = reference[CHI_DOT, ALPHA + j]
        torques[j] = (
            p.joint_armature * reference[CHI_DDOT, ALPHA + j]
            + p.joint_damping * speed
            + p.joint_friction * math.tanh(speed / FRICTION_SPEED)
        )
    moment = x = z = x_bend = z_bend = 0.0  # of the joint of link i
    for i in range(n):
        reach = p.link_centres[i]
        along = p.link_masses[i] * (force[X] + x_bend + reach * bends[i, 0])
        upward = p.link_masses[i] * (force[Z] + z_bend + reach * bends[i, 1])
        moment += (z - reach * cosines[i]) * along - (x + reach * sines[i]) * upward
        # d centre / d alpha_j: the lengths from joint j on, turned by a quarter
        across = lift = 0.0
        for k in range(i, -1, -1):
            length = reach if k == i else p.link_lengths[k]
            across += length * cosines[k]
            lift += length * sines[k]
            torques[k] += across * along + lift * upward
        x += p.link_lengths[i] * sines[i]
        z -= p.link_lengths[i] * cosines[i]
        x_bend += p.link_lengths[i] * bends[i, 0]
        z_bend += p.link_lengths[i] * bends[i, 1]
    return moment
