"""The end effector in the world, and the levers of a weight there, from the state."""

from __future__ import annotations

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.hand import hand_in_world
from uam_control.arm.kinematics import hand_jacobian
from uam_control.coordinates import ALPHA, ROLL
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import matrix_from_euler
from uam_control.maths.vectors import dot, times, vector


@jit
def hand_and_levers(chain: Chain, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the end effector (3,) [m, world], and its height per angle of each joint (n,) [m/rad].

    chi (6 + n,): generalised coordinates. A weight there needs its lever in torque at the joint.
    """
    place, _ = hand_in_world(chain, chi)
    up, count = vector(matrix_from_euler(chi[ROLL:ALPHA])[2]), len(chi) - ALPHA
    jacobian, hand, levers = np.empty((6, count)), np.empty(3), np.empty(count)
    hand_jacobian(chain, chi[ALPHA:], times(-1.0, up), jacobian)
    hand[0], hand[1], hand[2] = place
    for i in range(count):
        levers[i] = dot(up, vector(jacobian[:3, i]))
    return hand, levers
