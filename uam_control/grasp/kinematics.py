"""Position of the end effector in the world, and its levers, from the state."""

from __future__ import annotations

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.kinematics import hand_jacobian, hand_pose
from uam_control.coordinates import ALPHA, ROLL, X
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import matrix_from_euler
from uam_control.maths.vectors import dot, rows, times, turned


@jit
def hand_and_levers(chain: Chain, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the end effector (3,) [m, world], and its height per angle of each joint (n,) [m/rad].

    chi (6 + n,): generalised coordinates. A weight there needs its lever in torque at the joint.
    """
    rotation = rows(matrix_from_euler(chi[ROLL:ALPHA]))
    up, angles = rotation[2], chi[ALPHA:]
    position, _ = hand_pose(chain, angles, times(-1.0, up))
    jacobian, hand, levers = np.empty((6, len(angles))), np.empty(3), np.empty(len(angles))
    hand_jacobian(chain, angles, times(-1.0, up), jacobian)
    place = turned(rotation, position)
    for k in range(3):
        hand[k] = chi[X + k] + place[k]
    for i in range(len(angles)):
        levers[i] = dot(up, (jacobian[0, i], jacobian[1, i], jacobian[2, i]))
    return hand, levers
